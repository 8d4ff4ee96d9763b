# One module = one library target, made the same way: warnings, determinism flags, header set, install and export.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

find_program(SUPPLE_CCACHE ccache)
if(SUPPLE_CCACHE AND PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${SUPPLE_CCACHE})
endif()
if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_RUNTIME_OUTPUT_DIRECTORY)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
endif()

add_library(supple_flags INTERFACE)
target_compile_features(supple_flags INTERFACE cxx_std_20)
# AVX2 and FMA are the documented minimum; contraction off, because fma is written where it is wanted.
target_compile_options(supple_flags INTERFACE
  -march=x86-64-v3 -ffp-contract=off -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC bug 105651: false -Wrestrict on std::string concatenation.
  target_compile_options(supple_flags INTERFACE -Wno-restrict)
endif()
if(SUPPLE_WARNINGS_AS_ERRORS AND NOT SUPPLE_SANITIZE)  # what sanitizers add leads GCC to false alarms
  target_compile_options(supple_flags INTERFACE -Werror)
endif()
if(SUPPLE_SANITIZE)
  list(JOIN SUPPLE_SANITIZE "," supple_sanitizers)
  # Lines are all that reports name; full debug information takes a quarter of the build.
  target_compile_options(supple_flags INTERFACE -fsanitize=${supple_sanitizers} -fno-omit-frame-pointer -O1 -g1)
  target_link_options(supple_flags INTERFACE -fsanitize=${supple_sanitizers})
  if(supple_sanitizers MATCHES "undefined")
    target_compile_options(supple_flags INTERFACE -fno-sanitize-recover=undefined)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # GCC takes two to three times as long with these; the address sanitizer stops at what the first two would find,
      # and scripts/check_all.sh sanitizers has clang look for all of them.
      target_compile_options(supple_flags INTERFACE -fno-sanitize=null,object-size,alignment)
    endif()
  endif()
endif()

# What most files include is read once a target; a quarter to a third of the compiler's time otherwise.
option(SUPPLE_PRECOMPILE_HEADERS "Precompile the headers of Eigen, GoogleTest and the standard library" ${PROJECT_IS_TOP_LEVEL})
function(supple_precompile target)
  if(SUPPLE_PRECOMPILE_HEADERS)
    target_precompile_headers(${target} PRIVATE
      <algorithm> <array> <cmath> <cstdint> <functional> <limits> <map> <memory> <numbers> <numeric> <optional> <span>
      <string> <string_view> <tuple> <utility> <vector> <Eigen/Core> <Eigen/Geometry> ${ARGN})
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      target_compile_options(${target} PRIVATE -fpch-preprocess)  # lets ccache read the compiler's input
    endif()
  endif()
endfunction()

# supple_module(NAME HEADERS h... SOURCES s... [PUBLIC targets] [PRIVATE targets])
# HEADERS are relative to include/supple/NAME.
function(supple_module name)
  cmake_parse_arguments(arg "" "" "HEADERS;SOURCES;PUBLIC;PRIVATE" ${ARGN})
  set(target supple_${name})
  add_library(${target} ${arg_SOURCES})
  add_library(supple::${name} ALIAS ${target})
  list(TRANSFORM arg_HEADERS PREPEND "include/supple/${name}/")
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS include FILES ${arg_HEADERS})
  target_include_directories(${target} PRIVATE src)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE} $<BUILD_INTERFACE:supple_flags>)
  supple_precompile(${target})
  set_target_properties(${target} PROPERTIES
    EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON INSTALL_RPATH "$ORIGIN"
    VERIFY_INTERFACE_HEADER_SETS ON)
  install(TARGETS ${target} EXPORT suppleTargets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
    FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
endfunction()

# supple_test(MODULE SOURCES s... [LIBRARIES targets]): one test program per module, <module>_tests.
function(supple_test module)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
  set(source_dir ${PROJECT_SOURCE_DIR}/tests/support/source_dir.cpp)
  set_source_files_properties(${source_dir} PROPERTIES
    COMPILE_DEFINITIONS SUPPLE_SOURCE_DIR="${PROJECT_SOURCE_DIR}" SKIP_PRECOMPILE_HEADERS ON)
  add_executable(${module}_tests ${arg_SOURCES} ${source_dir})
  target_include_directories(${module}_tests PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_link_libraries(${module}_tests PRIVATE supple::${module} ${arg_LIBRARIES} supple_flags GTest::gtest_main)
  supple_precompile(${module}_tests <gtest/gtest.h> <filesystem> <fstream> <sstream>)
  file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/tests-tmp)  # two builds may test at the same time
  gtest_discover_tests(${module}_tests
    PROPERTIES LABELS ${module} ENVIRONMENT TEST_TMPDIR=${PROJECT_BINARY_DIR}/tests-tmp DISCOVERY_TIMEOUT 60 TIMEOUT 600)
endfunction()

function(supple_install_package)
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/suppleConfig.cmake.in
    ${PROJECT_BINARY_DIR}/suppleConfig.cmake INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supple)
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/suppleConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(EXPORT suppleTargets NAMESPACE supple:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supple)
  install(FILES ${PROJECT_BINARY_DIR}/suppleConfig.cmake ${PROJECT_BINARY_DIR}/suppleConfigVersion.cmake
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supple)
endfunction()
