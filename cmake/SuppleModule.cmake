# One module = one library target, made the same way: warnings, determinism flags, header set, install and export.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
include(SuppleLibraries)

find_program(SUPPLE_CCACHE ccache)
if(SUPPLE_CCACHE AND PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${SUPPLE_CCACHE})
endif()
if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_RUNTIME_OUTPUT_DIRECTORY)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
endif()

add_library(supple_flags INTERFACE)
target_compile_features(supple_flags INTERFACE cxx_std_20)
# AVX2 and FMA are the documented minimum; contraction is off, because the code calls fma explicitly.
target_compile_options(supple_flags INTERFACE
  -march=x86-64-v3 -ffp-contract=off -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC bug 105651: false -Wrestrict on std::string concatenation.
  target_compile_options(supple_flags INTERFACE -Wno-restrict)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC collects its garbage from 128 MB on, which takes a sixth of its time; a group of files takes about a gigabyte.
  target_compile_options(supple_flags INTERFACE --param=ggc-min-heapsize=1048576)
endif()
if(SUPPLE_WARNINGS_AS_ERRORS AND NOT SUPPLE_SANITIZE)  # what sanitizers add leads GCC to false alarms
  target_compile_options(supple_flags INTERFACE -Werror)
endif()
# These checks take half of the compiler's time; the address sanitizer finds the faults of the first two.
option(SUPPLE_QUICK_SANITIZERS "Sanitizers without the checks of null pointers, sizes of objects and alignment" OFF)
if(SUPPLE_SANITIZE)
  list(JOIN SUPPLE_SANITIZE "," supple_sanitizers)
  # Reports need line numbers only; full debug information takes a quarter of the build.
  target_compile_options(supple_flags INTERFACE -fsanitize=${supple_sanitizers} -fno-omit-frame-pointer -O1 -g1)
  target_link_options(supple_flags INTERFACE -fsanitize=${supple_sanitizers})
  if(supple_sanitizers MATCHES "undefined")
    target_compile_options(supple_flags INTERFACE -fno-sanitize-recover=undefined)
    if(SUPPLE_QUICK_SANITIZERS)
      target_compile_options(supple_flags INTERFACE -fno-sanitize=null,object-size,alignment)
    endif()
  endif()
endif()
set(supple_fuzzed core render scenes)  # the modules that read files: their coverage leads the fuzz targets
option(SUPPLE_FUZZ "Build the fuzz targets as programs of libFuzzer; clang only" OFF)

# Precompiled headers: common includes are read once for all files with the same options, which saves a quarter to a third of the
# compiler's time.
option(SUPPLE_PRECOMPILE_HEADERS "Precompile the headers of Eigen, GoogleTest and the standard library" ${PROJECT_IS_TOP_LEVEL})
set(supple_common_headers
  <algorithm> <array> <cmath> <cstdint> <functional> <limits> <map> <memory> <numbers> <numeric> <optional> <span>
  <string> <string_view> <tuple> <utility> <vector> <Eigen/Core> <Eigen/Geometry>)

# supple_precompile(TARGET OWNER PIC LIBRARIES headers...): uses the precompiled headers of OWNER, a target that is made for the first TARGET.
# OWNER has the compile options of TARGET, of which GCC takes the level of optimisation from the headers, and defines no macros: GCC accepts precompiled headers for files with more macros, not with fewer.
function(supple_precompile target owner pic libraries)
  if(NOT SUPPLE_PRECOMPILE_HEADERS)
    return()
  endif()
  if(NOT TARGET ${owner})
    file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/${owner}.cpp CONTENT "// Nothing but precompiled headers.\n")
    add_library(${owner} OBJECT ${PROJECT_BINARY_DIR}/${owner}.cpp)
    target_link_libraries(${owner} PRIVATE ${libraries} supple_flags)
    set_target_properties(${owner} PROPERTIES POSITION_INDEPENDENT_CODE ${pic})
    get_target_property(options ${target} COMPILE_OPTIONS)
    if(options)
      target_compile_options(${owner} PRIVATE ${options})
    endif()
    target_precompile_headers(${owner} PRIVATE ${supple_common_headers} ${ARGN})
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      target_compile_options(${owner} PRIVATE -fpch-preprocess)  # lets ccache read the compiler's input
    endif()
  endif()
  target_precompile_headers(${target} REUSE_FROM ${owner})
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fpch-preprocess)
  endif()
endfunction()

# Files of a module without common names are compiled as one (together.cmake): half of the compiler's time for a full build, more
# after a small change. So by default builds with tests, which are used for development, compile each file alone.
if(SUPPLE_BUILD_TESTS)
  set(supple_unity_build OFF)
else()
  set(supple_unity_build ON)
endif()
option(SUPPLE_UNITY_BUILD "Compile files of a module in groups" ${supple_unity_build})
if(SUPPLE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC treats the files of a group as headers, where private types of a file may not be members of others.
  # Inlining across files leads to false warnings about memory, which therefore are not errors.
  target_compile_options(supple_flags INTERFACE -Wno-subobject-linkage -Wno-error=maybe-uninitialized -Wno-error=uninitialized
    -Wno-error=array-bounds -Wno-error=stringop-overflow -Wno-error=stringop-overread -Wno-error=dangling-pointer
    -Wno-error=use-after-free -Wno-error=free-nonheap-object -Wno-error=null-dereference)
endif()

# supple_together("file file..." ...): the groups of a module. scripts/together.py makes and checks them.
function(supple_together)
  set(number 0)
  foreach(group IN LISTS ARGN)
    math(EXPR number "${number} + 1")
    separate_arguments(files UNIX_COMMAND "${group}")
    set_source_files_properties(${files} PROPERTIES UNITY_GROUP group_${number})
  endforeach()
endfunction()

# supple_module(NAME [OWN_OPTIONS] HEADERS h... SOURCES s... [PUBLIC targets] [PRIVATE targets])
# HEADERS are relative to include/supple/NAME. OWN_OPTIONS: the module has compile options of its own, so it shares no precompiled headers.
function(supple_module name)
  cmake_parse_arguments(arg "OWN_OPTIONS" "" "HEADERS;SOURCES;PUBLIC;PRIVATE" ${ARGN})
  set(target supple_${name})
  add_library(${target} ${arg_SOURCES})
  add_library(supple::${name} ALIAS ${target})
  list(TRANSFORM arg_HEADERS PREPEND "include/supple/${name}/")
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS include FILES ${arg_HEADERS})
  target_include_directories(${target} PRIVATE src)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE} $<BUILD_INTERFACE:supple_flags>)
  if(SUPPLE_FUZZ AND name IN_LIST supple_fuzzed)
    target_compile_options(${target} PRIVATE -fsanitize-coverage=inline-8bit-counters,indirect-calls,trace-cmp,pc-table)  # precompiled headers are shared with modules without it
  endif()
  if(NOT arg_OWN_OPTIONS)
    supple_precompile(${target} supple_headers ON Eigen3::Eigen)
  endif()
  set_target_properties(${target} PROPERTIES
    EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON INSTALL_RPATH "$ORIGIN"
    VERIFY_INTERFACE_HEADER_SETS ON UNITY_BUILD ${SUPPLE_UNITY_BUILD} UNITY_BUILD_MODE GROUP)
  set_property(GLOBAL APPEND PROPERTY SUPPLE_INSTALLED ${name})
  install(TARGETS ${target} EXPORT supple_${name}Targets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
    FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT supple_${name}Targets NAMESPACE supple:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supple)
endfunction()

# Tests whose own code has no sanitizers: their objects are those of another build, which saves the half of a build.
set(SUPPLE_BUILT_TESTS "" CACHE PATH "A build folder of the same source, compiled for the same ABI, whose test objects are linked with the modules of this one")

# supple_test(MODULE SOURCES s... [LIBRARIES targets]): one test program per module, <module>_tests.
function(supple_test module)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
  set(target ${module}_tests)
  set(list ${module}_objects.txt)
  if(SUPPLE_BUILT_TESTS)
    set(built ${SUPPLE_BUILT_TESTS}/tests/${list})
    if(NOT EXISTS ${built})
      message(FATAL_ERROR "SUPPLE_BUILT_TESTS: expected ${built}; build the tests there first")
    endif()
    file(STRINGS ${built} objects)
    # Of an inline function that both have, the linker takes the first: that of the module, with sanitizers.
    add_executable(${target} $<TARGET_OBJECTS:supple_${module}>)
    target_link_libraries(${target} PRIVATE ${objects})
  else()
    set(source_dir ${PROJECT_SOURCE_DIR}/tests/support/source_dir.cpp)
    set_source_files_properties(${source_dir} PROPERTIES
      COMPILE_DEFINITIONS SUPPLE_SOURCE_DIR="${PROJECT_SOURCE_DIR}" SKIP_PRECOMPILE_HEADERS ON)
    add_executable(${target} ${arg_SOURCES} ${source_dir} ${PROJECT_SOURCE_DIR}/tests/support/temp_folder.cpp)
    file(GENERATE OUTPUT ${PROJECT_BINARY_DIR}/tests/${list} CONTENT "$<JOIN:$<TARGET_OBJECTS:${target}>,\n>\n")
    set_target_properties(${target} PROPERTIES UNITY_BUILD ${SUPPLE_UNITY_BUILD} UNITY_BUILD_MODE GROUP)
    target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
    # Tests take two thirds of the compiler's time with -O1, and about as long when they run: what they call is optimised.
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
    supple_precompile(${target} supple_test_headers OFF "supple::core;GTest::gtest_main" <gtest/gtest.h> <filesystem> <fstream> <sstream>)
  endif()
  target_link_libraries(${target} PRIVATE supple::${module} ${arg_LIBRARIES} supple_flags GTest::gtest_main)
  file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/tests-tmp)  # two builds may test at the same time
  set(limit 600)  # [s]
  if(SUPPLE_SANITIZE)
    set(limit 3600)
  endif()
  gtest_discover_tests(${target}
    PROPERTIES LABELS ${module} ENVIRONMENT TMPDIR=${PROJECT_BINARY_DIR}/tests-tmp DISCOVERY_TIMEOUT 60 TIMEOUT ${limit})
  # The start of a program with sanitizers takes as long as most tests: parts of all tests but the longest, for scripts/test.sh.
  if(SUPPLE_SANITIZE AND ${module} MATCHES "core|implicit|collision")
    set(parts 4)
    file(STRINGS ${PROJECT_SOURCE_DIR}/tests/long_tests.txt long)
    list(JOIN long ":" long)
    foreach(part RANGE 1 ${parts})
      math(EXPR index "${part} - 1")
      add_test(NAME Quick.${module}.${part} COMMAND ${target} --gtest_brief=1)
      set_tests_properties(Quick.${module}.${part} PROPERTIES LABELS quick TIMEOUT ${limit}
        ENVIRONMENT "TMPDIR=${PROJECT_BINARY_DIR}/tests-tmp;GTEST_FILTER=-${long};GTEST_TOTAL_SHARDS=${parts};GTEST_SHARD_INDEX=${index}")
    endforeach()
  endif()
endfunction()

# Installs the CMake package, scenes, documents and licence; each library installs itself.
function(supple_install_package)
  get_property(SUPPLE_INSTALLED GLOBAL PROPERTY SUPPLE_INSTALLED)
  list(JOIN SUPPLE_INSTALLED " " SUPPLE_INSTALLED)
  get_property(SUPPLE_RENDER_LIBRARIES GLOBAL PROPERTY SUPPLE_RENDER_LIBRARIES)
  list(JOIN SUPPLE_RENDER_LIBRARIES " " SUPPLE_RENDER_LIBRARIES)
  get_property(SUPPLE_FIT_LIBRARIES GLOBAL PROPERTY SUPPLE_FIT_LIBRARIES)
  list(JOIN SUPPLE_FIT_LIBRARIES " " SUPPLE_FIT_LIBRARIES)
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/suppleConfig.cmake.in
    ${PROJECT_BINARY_DIR}/suppleConfig.cmake INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supple)
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/suppleConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/suppleConfig.cmake ${PROJECT_BINARY_DIR}/suppleConfigVersion.cmake
    ${PROJECT_SOURCE_DIR}/cmake/SuppleLibraries.cmake DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/supple)
  install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
  install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} PATTERN reports EXCLUDE)
  if(scenes IN_LIST SUPPLE_MODULES)
    install(DIRECTORY scenes/library DESTINATION ${CMAKE_INSTALL_DATADIR}/supple/scenes)
    install(FILES scenes/blender/supple_import.py DESTINATION ${CMAKE_INSTALL_DATADIR}/supple/blender)
    install(FILES scenes/viewer/LICENSE.three DESTINATION ${CMAKE_INSTALL_DOCDIR})
  endif()
endfunction()
