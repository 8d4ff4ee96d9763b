# Libraries without a CMake package of their own, as targets: those of this build, and, from the installed package, those of the
# machine that uses it.

# supple_library(NAME LIBRARY [REQUIRED]): makes supple::NAME of what find_library finds by that name, if it finds it.
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
