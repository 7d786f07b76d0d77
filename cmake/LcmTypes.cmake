# add_lcm_types(<name> PACKAGE <package> TYPES a.lcm b.lcm ...)
#
# Generates from one .lcm file per struct:
#   <name>          interface library: C++11 headers "<package>/<struct>.hpp", hardened against hostile lengths
#   <name>_c        static library: what lcm-gen says of each type's fields, for reflection (common/message_type)
#   <name>_python   custom target: Python modules in <build>/lcmtypes/python/<package>
#   <name>_java     custom target (where javac and lcm.jar are): <build>/lcmtypes/<name>.jar, for lcm-spy
find_package(Java COMPONENTS Development QUIET)

function(add_lcm_types name)
  cmake_parse_arguments(ARG "" "PACKAGE" "TYPES" ${ARGN})
  set(cpp ${CMAKE_CURRENT_BINARY_DIR}/cpp)
  set(c ${CMAKE_CURRENT_BINARY_DIR}/c)
  set(python ${CMAKE_CURRENT_BINARY_DIR}/python)
  set(java ${CMAKE_CURRENT_BINARY_DIR}/java)
  set(harden ${PROJECT_SOURCE_DIR}/cmake/harden_lcm_gen.sh)

  foreach(type ${ARG_TYPES})
    get_filename_component(struct ${type} NAME_WE)
    set(source ${CMAKE_CURRENT_SOURCE_DIR}/${type})
    set(header ${cpp}/${ARG_PACKAGE}/${struct}.hpp)
    add_custom_command(OUTPUT ${header}
      COMMAND ${LCM_GEN_EXECUTABLE} -x --cpp-std=c++11 --cpp-hpath ${cpp} ${source}
      COMMAND ${harden} ${header}
      DEPENDS ${source} ${harden} VERBATIM)
    list(APPEND headers ${header})
    set(c_files ${c}/${ARG_PACKAGE}_${struct}.c ${c}/${ARG_PACKAGE}_${struct}.h)
    add_custom_command(OUTPUT ${c_files}
      COMMAND ${LCM_GEN_EXECUTABLE} -c --c-typeinfo --c-cpath ${c} --c-hpath ${c} ${source} DEPENDS ${source} VERBATIM)
    list(APPEND c_sources ${c_files})
    string(APPEND c_includes "#include \"${ARG_PACKAGE}_${struct}.h\"\n")
    string(APPEND c_entries "  {\"${struct}\", ${ARG_PACKAGE}_${struct}_get_type_info},\n")
    list(APPEND modules ${python}/${ARG_PACKAGE}/${struct}.py)
    list(APPEND java_sources ${java}/${ARG_PACKAGE}/${struct}.java)
    list(APPEND sources ${source})
  endforeach()

  add_custom_target(${name}_headers DEPENDS ${headers})
  add_library(${name} INTERFACE)
  add_dependencies(${name} ${name}_headers)
  # SYSTEM: generated code is not held to our warnings.
  target_include_directories(${name} SYSTEM INTERFACE $<BUILD_INTERFACE:${cpp}>)
  target_link_libraries(${name} INTERFACE LCM::LCM)

  configure_file(${PROJECT_SOURCE_DIR}/cmake/message_types.c.in ${c}/message_types.c @ONLY)
  add_library(${name}_c STATIC ${c_sources} ${c}/message_types.c)
  target_include_directories(${name}_c SYSTEM PRIVATE ${c})
  target_link_libraries(${name}_c PRIVATE LCM::LCM)
  target_compile_options(${name}_c PRIVATE -w)  # nor is this

  # By one command: each adds its struct to the package's __init__.py, and of two at once one would be lost.
  add_custom_command(OUTPUT ${modules}
    COMMAND ${LCM_GEN_EXECUTABLE} -p --ppath ${python} ${sources} DEPENDS ${sources} VERBATIM)
  add_custom_target(${name}_python DEPENDS ${modules})
  if(Java_JAVAC_EXECUTABLE AND Java_JAR_EXECUTABLE AND LCM_JAR)
    set(jar ${CMAKE_CURRENT_BINARY_DIR}/${name}.jar)
    add_custom_command(OUTPUT ${jar}
      COMMAND ${LCM_GEN_EXECUTABLE} -j --jpath ${java} ${sources}
      COMMAND ${Java_JAVAC_EXECUTABLE} -cp ${LCM_JAR} -d ${java}/classes ${java_sources}
      COMMAND ${Java_JAR_EXECUTABLE} cf ${jar} -C ${java}/classes .
      DEPENDS ${sources} VERBATIM)
    add_custom_target(${name}_java DEPENDS ${jar})
  endif()
endfunction()
