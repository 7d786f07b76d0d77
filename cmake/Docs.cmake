# docs/ as a site, and the public headers' API beside it: `ninja -C build docs_site docs_api` (scripts/setup --docs), into
# build/site. Not part of a build; a target is there where its program is.
find_program(MKDOCS mkdocs)
if(MKDOCS)
  add_custom_target(docs_site
    COMMAND ${MKDOCS} build --quiet --strict --site-dir ${PROJECT_BINARY_DIR}/site
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    COMMENT "The documents as a site: ${PROJECT_BINARY_DIR}/site/index.html" VERBATIM)
endif()
find_program(DOXYGEN doxygen)
if(DOXYGEN)
  configure_file(cmake/Doxyfile.in Doxyfile @ONLY)
  add_custom_target(docs_api
    COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/site/api
    COMMAND ${DOXYGEN} ${PROJECT_BINARY_DIR}/Doxyfile
    COMMENT "The headers' API: ${PROJECT_BINARY_DIR}/site/api/index.html" VERBATIM)
  if(MKDOCS)
    add_dependencies(docs_api docs_site)  # which empties the folder
  endif()
endif()
find_program(HELP2MAN help2man)
if(HELP2MAN)
  add_custom_target(man
    COMMAND ${PROJECT_SOURCE_DIR}/scripts/man ${PROJECT_BINARY_DIR} ${PROJECT_BINARY_DIR}/man
    COMMENT "Man pages of all programs: ${PROJECT_BINARY_DIR}/man" VERBATIM)
  add_dependencies(man programs)
endif()
