# The kinds of target in this house. Dependencies point down only: a folder's library links the
# libraries below it and nothing else (tests/layering_test.py checks the includes).

add_library(plumb_warnings INTERFACE)
target_compile_options(plumb_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Werror
  # GCC 12 sees ghosts in Eigen's inlined packet loads, and where std::string's headers are precompiled.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds -Wno-maybe-uninitialized -Wno-stringop-overflow>)

# Headers that are many and large, parsed once for all of our targets instead of once for each file. Files include what
# they use all the same: cmake -D CMAKE_DISABLE_PRECOMPILE_HEADERS=ON builds without.
set(plumb_precompiled <algorithm> <array> <chrono> <cmath> <cstdint> <filesystem> <fstream> <functional> <iostream> <limits> <map>
  <memory> <numeric> <optional> <set> <span> <sstream> <stdexcept> <string> <string_view> <utility> <vector>
  <Eigen/Dense> <fmt/format.h>)

# Several files compiled as one take two thirds of the time. So names in a folder's unnamed namespaces differ from each other;
# APART is for folders whose files have the same names for the same things, as each protocol has its Step.
option(PLUMBLINE_UNITY "compile several files as one" ON)
function(plumb_unity target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${PLUMBLINE_UNITY} UNITY_BUILD_BATCH_SIZE 5)
endfunction()

# plumb_library(<folder> [APART] SOURCES a.cc ... LINKS other ...) -> static library plumb_<folder>
function(plumb_library name)
  cmake_parse_arguments(ARG "APART" "" "SOURCES;LINKS" ${ARGN})
  add_library(plumb_${name} STATIC ${ARG_SOURCES})
  target_include_directories(plumb_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  target_link_libraries(plumb_${name} PUBLIC ${ARG_LINKS} PRIVATE $<BUILD_INTERFACE:plumb_warnings>)
  if(NOT ARG_APART)
    plumb_unity(plumb_${name})
  endif()
  if(name STREQUAL common)
    target_precompile_headers(plumb_common PRIVATE ${plumb_precompiled})
  else()
    target_precompile_headers(plumb_${name} REUSE_FROM plumb_common)
  endif()
endfunction()

# plumb_process(<name> main.cc ... LINKS other ...) -> executable <build>/bin/plumb-<name>
function(plumb_process name)
  cmake_parse_arguments(ARG "" "" "LINKS" ${ARGN})
  add_executable(plumb-${name} ${ARG_UNPARSED_ARGUMENTS})
  set_target_properties(plumb-${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  target_link_libraries(plumb-${name} PRIVATE ${ARG_LINKS} plumb_warnings)
  target_precompile_headers(plumb-${name} REUSE_FROM plumb_common)
endfunction()

# plumb_test(<name> [APART] [FOLDERS folder ...] LINKS ...) -> one Catch2 binary of tests/<folder>/*.cc, one CTest entry.
# Without FOLDERS the folder has the name.
function(plumb_test name)
  cmake_parse_arguments(ARG "APART" "" "FOLDERS;LINKS" ${ARGN})
  if(NOT ARG_FOLDERS)
    set(ARG_FOLDERS ${name})
  endif()
  list(TRANSFORM ARG_FOLDERS REPLACE "(.+)" "${PROJECT_SOURCE_DIR}/tests/\\1/*.cc")
  file(GLOB sources CONFIGURE_DEPENDS ${ARG_FOLDERS})
  if(NOT sources)
    return()
  endif()
  add_executable(${name}_test ${sources})
  if(NOT ARG_APART)
    plumb_unity(${name}_test)
  endif()
  target_link_libraries(${name}_test PRIVATE plumb_test_main ${ARG_LINKS} plumb_warnings)
  target_precompile_headers(${name}_test REUSE_FROM plumb_test_main)
  add_test(NAME ${name} COMMAND ${name}_test)
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "PLUMBLINE_SOURCE=${PROJECT_SOURCE_DIR};PLUMBLINE_BUILD=${PROJECT_BINARY_DIR}")
endfunction()

# plumb_levels(<name> SOURCES a.cc ... OPTIONS -O3 ...) -> shared library plumb_<name>, built once per level of instruction
# set under the same name: glibc's dynamic linker looks for the best one the machine can run in glibc-hwcaps/ beside the
# baseline, which is the one programs are linked to. Its functions are hidden unless they say otherwise: one compiled for
# one level must never stand in for that of another.
function(plumb_levels name)
  cmake_parse_arguments(ARG "" "" "SOURCES;OPTIONS" ${ARGN})
  foreach(level x86-64 x86-64-v3 x86-64-v4)
    set(target plumb_${name})
    set(directory "")
    if(NOT level STREQUAL x86-64)
      set(target plumb_${name}_${level})
      set(directory /glibc-hwcaps/${level})
    endif()
    add_library(${target} SHARED ${ARG_SOURCES})
    set_target_properties(${target} PROPERTIES
      OUTPUT_NAME plumb_${name}
      LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib${directory}
      CXX_VISIBILITY_PRESET hidden
      VISIBILITY_INLINES_HIDDEN ON)
    target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
    target_compile_definitions(${target} PRIVATE PLUMB_INSTRUCTION_SET="${level}")
    # -march without -mtune: GCC 12's tuning for particular processors costs a fifth of the speed.
    target_compile_options(${target} PRIVATE -march=${level} -mtune=generic ${ARG_OPTIONS})
    target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:plumb_warnings>)
    if(NOT level STREQUAL x86-64)
      add_dependencies(plumb_${name} ${target})
    endif()
  endforeach()
endfunction()
