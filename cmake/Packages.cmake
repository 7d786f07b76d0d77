# Debian's packages of what cmake/Install.cmake installs: `scripts/package` makes them.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME plumbline)
set(CPACK_PACKAGE_VENDOR "the Plumbline authors")
set(PLUMBLINE_MAINTAINER "Plumbline authors <plumbline@packages.invalid>" CACHE STRING "who answers for the packages: Name <address>")
set(CPACK_PACKAGE_CONTACT ${PLUMBLINE_MAINTAINER})
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL runtime dashboard dev python doc)
set(CPACK_COMPONENTS_GROUPING IGNORE)
# The copyright, the changelog and what else Debian wants of a package alone.
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/debian_files.cmake)
set(CPACK_PLUMBLINE_SOURCE ${PROJECT_SOURCE_DIR})

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/lib)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(this "(= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")

# plumb_package(<component> <package> SECTION s SUMMARY "..." TEXT "..." [DEPENDS d, e] [RECOMMENDS ...] [SUGGESTS ...] [ALL])
function(plumb_package component package)
  cmake_parse_arguments(ARG ALL "SECTION;SUMMARY;TEXT;DEPENDS;RECOMMENDS;SUGGESTS" "" ${ARGN})
  string(TOUPPER ${component} upper)
  set(prefix CPACK_DEBIAN_${upper}_PACKAGE)
  set(${prefix}_NAME ${package} PARENT_SCOPE)
  set(${prefix}_SECTION ${ARG_SECTION} PARENT_SCOPE)
  set(${prefix}_DEPENDS "${ARG_DEPENDS}" PARENT_SCOPE)
  set(${prefix}_RECOMMENDS "${ARG_RECOMMENDS}" PARENT_SCOPE)
  set(${prefix}_SUGGESTS "${ARG_SUGGESTS}" PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${ARG_SUMMARY}\n${ARG_TEXT}" PARENT_SCOPE)
  if(ARG_ALL)
    set(${prefix}_ARCHITECTURE all PARENT_SCOPE)
    set(${prefix}_SHLIBDEPS OFF PARENT_SCOPE)
  endif()
endfunction()

set(what "Plumbline runs a robot on a CAN bus, learns from a few seconds of its\nmotion which simulators could have produced it, \
and trains a policy\nunder exactly that distribution, round after round until the policy works.")
plumb_package(runtime plumbline SECTION science
  SUMMARY "keeps a simulator plumb with its robot"
  TEXT "${what}\n.\nThis package has the programs, robots, and services for systemd."
  RECOMMENDS "can-utils, iproute2" SUGGESTS "plumbline-dashboard ${this}, plumbline-doc")
plumb_package(dashboard plumbline-dashboard SECTION science
  SUMMARY "live page of a robot that Plumbline runs"
  TEXT "${what}\n.\nThis package shows a run in browsers, in Foxglove and in Lichtblick, and\nhas an emergency stop."
  DEPENDS "plumbline ${this}")
plumb_package(dev plumbline-dev SECTION libdevel
  SUMMARY "Plumbline's simulator and calibration for other programs"
  TEXT "${what}\n.\nThis package has headers and static libraries, and a CMake package:\nfind_package(plumbline) gives plumb::sim, plumb::calibrator\nand plumb::umbridge."
  DEPENDS "plumbline ${this}, liblcm-dev, libsodium-dev, libeigen3-dev, libfmt-dev, libspdlog-dev, nlohmann-json3-dev, libcli11-dev, \
libboost-dev, libtinyxml-dev, libtomlplusplus-dev, librandom123-dev"
  SUGGESTS "cmake, g++")
if(TARGET plumbline_native)
  plumb_package(python python3-plumbline SECTION python
    SUMMARY "Plumbline's simulator, calibration and policies in Python"
    TEXT "${what}\n.\nThis package is for Python: simulation in batches, calibration, policies, a\nvector environment for \
reinforcement learning, and a reader of LCM logs."
    DEPENDS "plumbline ${this}, ${PLUMBLINE_PYTHON_VERSIONS}, python3-numpy")
else()
  plumb_package(python python3-plumbline SECTION python ALL
    SUMMARY "reads Plumbline's logs in Python"
    TEXT "${what}\n.\nThis package reads LCM logs with Python's standard library alone, and\ndecodes Plumbline's messages."
    DEPENDS "python3:any")
endif()
set(scripts ${PROJECT_SOURCE_DIR}/packaging/python3-plumbline)
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${scripts}/postinst ${scripts}/prerm)
plumb_package(doc plumbline-doc SECTION doc ALL
  SUMMARY "documentation of Plumbline"
  TEXT "${what}\n.\nThis package has the documents, as Markdown and for browsers.")
include(CPack)
