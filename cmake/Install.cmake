# What `cmake --install build` puts where, in five components: runtime, dashboard, dev, python, doc. Everything is found from
# where the programs are, and so the folder it is all put into may be any, and moved. Pages, man pages and the site are
# installed where they have been built. Experiments and plumb-chaos run in a build, and are not installed.
set(home lib/plumbline)  # libraries that are nobody's but ours
set(kernels ${home}/kernels)
set(PLUMBLINE_PYTHON_DIR lib/python3/dist-packages CACHE STRING "where Python modules are installed, below the prefix")

# --- Programs, and the kernels that they find beside them -----------------------------------------------------------
set(programs plumb plumb-robot plumb-driver plumb-estimator plumb-controller plumb-calibrator plumb-trainer)
set_target_properties(${programs} plumb-dashboard PROPERTIES INSTALL_RPATH "$ORIGIN/../${kernels}")
install(TARGETS ${programs} RUNTIME DESTINATION bin COMPONENT runtime)
install(TARGETS plumb-dashboard RUNTIME DESTINATION bin COMPONENT dashboard)
# The baseline is also what others link to, with what they compile.
install(TARGETS plumb_kernels LIBRARY DESTINATION ${kernels} COMPONENT runtime)
install(TARGETS plumb_dynamics plumb_residual_kernels EXPORT plumbline LIBRARY DESTINATION ${kernels} COMPONENT runtime)
foreach(level x86-64-v3 x86-64-v4)
  foreach(kernel dynamics residual_kernels kernels)
    install(TARGETS plumb_${kernel}_${level} LIBRARY DESTINATION ${kernels}/glibc-hwcaps/${level} COMPONENT runtime)
  endforeach()
endforeach()

# --- What they read, and what people read of them --------------------------------------------------------------------
install(DIRECTORY robots DESTINATION share/plumbline COMPONENT runtime)
install(DIRECTORY lcmtypes DESTINATION share/plumbline COMPONENT runtime FILES_MATCHING PATTERN "*.lcm")
install(DIRECTORY ${PROJECT_BINARY_DIR}/dashboard/page/ DESTINATION share/plumbline/dashboard COMPONENT dashboard OPTIONAL)
foreach(name ${programs} plumb-dashboard)  # bash looks for a file of the command's name
  set(component runtime)
  if(name STREQUAL plumb-dashboard)
    set(component dashboard)
  endif()
  install(FILES scripts/plumb-completion.bash DESTINATION share/bash-completion/completions RENAME ${name} COMPONENT ${component})
endforeach()
set(man ${PROJECT_BINARY_DIR}/man)
get_property(experiments GLOBAL PROPERTY PLUMB_EXPERIMENTS)
list(JOIN experiments "|" experiments)
install(DIRECTORY ${man}/ DESTINATION share/man/man1 COMPONENT runtime OPTIONAL FILES_MATCHING PATTERN "*.1"
  REGEX "/plumb-(dashboard|chaos|${experiments})\\.1$" EXCLUDE)
install(FILES ${man}/plumb-dashboard.1 DESTINATION share/man/man1 COMPONENT dashboard OPTIONAL)
install(FILES README.md CHANGELOG.md CITATION.cff DESTINATION share/doc/plumbline COMPONENT runtime)
install(DIRECTORY docs DESTINATION share/doc/plumbline COMPONENT doc)
install(DIRECTORY ${PROJECT_BINARY_DIR}/site/ DESTINATION share/doc/plumbline/html COMPONENT doc OPTIONAL
  PATTERN "sitemap.xml*" EXCLUDE)

# --- Services: docs/install.md ---------------------------------------------------------------------------------------
install(DIRECTORY packaging/systemd/ DESTINATION lib/systemd/system COMPONENT runtime)
install(DIRECTORY packaging/networkd DESTINATION share/doc/plumbline/examples COMPONENT runtime)
install(FILES packaging/can0.conf DESTINATION share/doc/plumbline/examples COMPONENT runtime)

# --- Python: logs and the types of their messages, and, where it is built, plumbline --------------------------------
install(FILES python/plumb_log.py DESTINATION ${PLUMBLINE_PYTHON_DIR} COMPONENT python)
install(DIRECTORY ${PROJECT_BINARY_DIR}/lcmtypes/python/plumb DESTINATION ${PLUMBLINE_PYTHON_DIR} COMPONENT python OPTIONAL
  FILES_MATCHING PATTERN "*.py")
if(TARGET plumbline_native)
  file(RELATIVE_PATH kernels_of_python /${PLUMBLINE_PYTHON_DIR}/plumbline /${kernels})
  set_target_properties(plumbline_native PROPERTIES INSTALL_RPATH "$ORIGIN/${kernels_of_python}")
  install(DIRECTORY python/plumbline DESTINATION ${PLUMBLINE_PYTHON_DIR} COMPONENT python
    FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN py.typed PATTERN __pycache__ EXCLUDE)
  install(TARGETS plumbline_native LIBRARY DESTINATION ${PLUMBLINE_PYTHON_DIR}/plumbline COMPONENT python OPTIONAL)
endif()

# --- For programs of others: plumb::sim, plumb::calibrator, plumb::umbridge and what they stand on -------------------
set(libraries lcmtypes lcmtypes_c common urdf robot tasks sim plot inference motion fit diagnostics gap design results report live
  calibrator http umbridge)
foreach(library ${libraries} dynamics residual_kernels)
  set_target_properties(plumb_${library} PROPERTIES EXPORT_NAME ${library})
endforeach()
# What holds for our own objects as a whole must hold for those that are linked to them.
target_compile_features(plumb_common INTERFACE $<INSTALL_INTERFACE:cxx_std_20>)
target_compile_definitions(plumb_common INTERFACE $<INSTALL_INTERFACE:EIGEN_NO_CPUID>)
target_compile_options(plumb_common INTERFACE $<INSTALL_INTERFACE:-ffp-contract=off>)
list(TRANSFORM libraries PREPEND plumb_)
install(TARGETS ${libraries} EXPORT plumbline ARCHIVE DESTINATION ${home} COMPONENT dev INCLUDES DESTINATION include/plumbline)
foreach(room common plot robot sim calibrator http umbridge)
  install(DIRECTORY ${room} DESTINATION include/plumbline COMPONENT dev FILES_MATCHING PATTERN "*.h"
    PATTERN sim/view EXCLUDE PATTERN sim/virtual EXCLUDE)
endforeach()
install(DIRECTORY ${PROJECT_BINARY_DIR}/lcmtypes/cpp/plumb DESTINATION include/plumbline COMPONENT dev FILES_MATCHING PATTERN "*.hpp")
include(CMakePackageConfigHelpers)
configure_package_config_file(cmake/plumblineConfig.cmake.in ${PROJECT_BINARY_DIR}/cmake/plumblineConfig.cmake
  INSTALL_DESTINATION lib/cmake/plumbline)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cmake/plumblineConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/cmake/plumblineConfig.cmake ${PROJECT_BINARY_DIR}/cmake/plumblineConfigVersion.cmake
  cmake/FindLCM.cmake cmake/FindSodium.cmake DESTINATION lib/cmake/plumbline COMPONENT dev)
install(EXPORT plumbline NAMESPACE plumb:: FILE plumblineTargets.cmake DESTINATION lib/cmake/plumbline COMPONENT dev)
install(DIRECTORY examples DESTINATION share/doc/plumbline COMPONENT dev)
