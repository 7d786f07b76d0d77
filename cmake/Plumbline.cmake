# The three kinds of target in this house. Dependencies point down only: a folder's library links the
# libraries below it and nothing else (tests/layering_test.py checks the includes).

add_library(plumb_warnings INTERFACE)
target_compile_options(plumb_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Werror
  # GCC 12 sees ghosts in Eigen's inlined packet loads.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds -Wno-maybe-uninitialized>)

# plumb_library(<folder> SOURCES a.cc ... LINKS other ...) -> static library plumb_<folder>
function(plumb_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  add_library(plumb_${name} STATIC ${ARG_SOURCES})
  target_include_directories(plumb_${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(plumb_${name} PUBLIC ${ARG_LINKS} PRIVATE plumb_warnings)
endfunction()

# plumb_process(<name> main.cc ... LINKS other ...) -> executable <build>/bin/plumb-<name>
function(plumb_process name)
  cmake_parse_arguments(ARG "" "" "LINKS" ${ARGN})
  add_executable(plumb-${name} ${ARG_UNPARSED_ARGUMENTS})
  set_target_properties(plumb-${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  target_link_libraries(plumb-${name} PRIVATE ${ARG_LINKS} plumb_warnings)
endfunction()

# plumb_test(<folder> LINKS ...) -> one Catch2 binary of tests/<folder>/*_test.cc, one CTest entry
function(plumb_test folder)
  cmake_parse_arguments(ARG "" "" "LINKS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/tests/${folder}/*_test.cc)
  if(NOT sources)
    return()
  endif()
  add_executable(${folder}_test ${sources})
  target_link_libraries(${folder}_test PRIVATE plumb_test_main ${ARG_LINKS} plumb_warnings)
  add_test(NAME ${folder} COMMAND ${folder}_test)
  set_tests_properties(${folder} PROPERTIES TIMEOUT 120 ENVIRONMENT "PLUMBLINE_SOURCE=${PROJECT_SOURCE_DIR};PLUMBLINE_BUILD=${PROJECT_BINARY_DIR}")
endfunction()
