# CVODES with its serial vector, dense matrix and solvers, as the one target dualdrive_sundials.
#
# Looked for in SUNDIALS_ROOT, then in .deps/sundials (made by cmake/build-sundials), then in the system.
# Why not the system's first: docs/adr/0001-sundials-from-source.md.

list(APPEND CMAKE_PREFIX_PATH "${CMAKE_CURRENT_SOURCE_DIR}/.deps/sundials")
find_package(SUNDIALS CONFIG QUIET)
if(NOT SUNDIALS_FOUND OR SUNDIALS_VERSION VERSION_LESS 6)
  message(FATAL_ERROR
    "SUNDIALS 6 or 7 was not found. On Debian or Ubuntu, `./dev build` makes an optimised one; "
    "elsewhere install SUNDIALS with CVODES and give its prefix as -DSUNDIALS_ROOT=...")
endif()

if(SUNDIALS_DIR MATCHES "^/usr/(lib|share)" AND EXISTS /etc/debian_version)
  message(WARNING
    "SUNDIALS ${SUNDIALS_VERSION} is Debian's own, compiled without optimisation: runs through CVODE take "
    "about 3.5 times as long. `./dev build` makes an optimised one in .deps/sundials.")
else()
  message(STATUS "SUNDIALS ${SUNDIALS_VERSION}: ${SUNDIALS_DIR}")
endif()

add_library(dualdrive_sundials INTERFACE)
# Version 6 calls its common part `generic`, version 7 `core`; either may come static, shared or both.
foreach(part cvodes nvecserial sunmatrixdense sunlinsoldense sunnonlinsolnewton sunnonlinsolfixedpoint
             generic core)
  foreach(kind _static _shared "")
    if(TARGET SUNDIALS::${part}${kind})
      target_link_libraries(dualdrive_sundials INTERFACE SUNDIALS::${part}${kind})
      break()
    endif()
  endforeach()
endforeach()
if(NOT TARGET SUNDIALS::cvodes_static AND NOT TARGET SUNDIALS::cvodes_shared AND NOT TARGET SUNDIALS::cvodes)
  message(FATAL_ERROR "SUNDIALS in ${SUNDIALS_DIR} has no CVODES; build it with -DBUILD_CVODES=ON")
endif()
