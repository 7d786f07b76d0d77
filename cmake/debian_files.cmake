# Run by CPack when a package's files are together, before they are packed: adds what Debian's policy wants in it.
function(compress file)
  execute_process(COMMAND gzip -9nf ${file} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

# The time of the commit: the same packages each time (scripts/package).
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
foreach(component ${CPACK_COMPONENTS_ALL})
  string(TOUPPER ${component} upper)
  set(package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  set(root ${CPACK_TEMPORARY_DIRECTORY}/${component}/usr)
  set(documents ${root}/share/doc/${package})
  file(READ ${CPACK_PLUMBLINE_SOURCE}/LICENSE license)
  file(WRITE ${documents}/copyright "Plumbline ${CPACK_PACKAGE_VERSION}\n\n${license}")
  file(WRITE ${documents}/changelog.Debian "plumbline (${CPACK_PACKAGE_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium

  * Version ${CPACK_PACKAGE_VERSION}: what has changed is in the package plumbline,
    /usr/share/doc/plumbline/changelog.gz.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
  compress(${documents}/changelog.Debian)
  file(GLOB pages ${root}/share/man/man1/*.1)
  foreach(page ${pages})
    compress(${page})
  endforeach()
endforeach()
set(documents ${CPACK_TEMPORARY_DIRECTORY}/runtime/usr/share/doc/plumbline)
file(RENAME ${documents}/CHANGELOG.md ${documents}/changelog)
compress(${documents}/changelog)
