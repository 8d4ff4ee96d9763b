# Targets for libraries without a CMake package: those of this build and, for the installed package, those of the
# machine that uses it.

# supple_library(NAME LIBRARY [REQUIRED]): makes the target supple::NAME of a library that find_library finds.
function(supple_library name library)
  if(TARGET supple::${name})
    return()
  endif()
  string(TOUPPER ${name} variable)
  find_library(SUPPLE_${variable}_LIBRARY ${library} ${ARGN})
  if(SUPPLE_${variable}_LIBRARY)
    add_library(supple::${name} UNKNOWN IMPORTED GLOBAL)
    set_target_properties(supple::${name} PROPERTIES IMPORTED_LOCATION "${SUPPLE_${variable}_LIBRARY}")
  endif()
endfunction()
