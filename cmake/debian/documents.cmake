# Run by cpack for the Debian package: its copyright and its changelog. The date is that of the last
# change, so that the same source gives the same package.
if(DEFINED ENV{DESTDIR})
  set(root $ENV{DESTDIR})
else()
  set(root ${CMAKE_INSTALL_PREFIX}/..)
endif()
set(documents ${root}/usr/share/doc/veneer)
file(REMOVE ${documents}/LICENSE)  # the text is in /usr/share/common-licenses
file(INSTALL ${CMAKE_CURRENT_LIST_DIR}/copyright DESTINATION /usr/share/doc/veneer)
execute_process(
  COMMAND git log -1 --format=%cD
  WORKING_DIRECTORY ${CMAKE_CURRENT_LIST_DIR} OUTPUT_VARIABLE date OUTPUT_STRIP_TRAILING_WHITESPACE
  RESULT_VARIABLE failed ERROR_QUIET)
if(failed)
  set(date "Thu, 01 Jan 1970 00:00:00 +0000")
endif()
file(WRITE ${documents}/changelog
"veneer (${CPACK_PACKAGE_VERSION}) bookworm; urgency=medium

  * Version ${CPACK_PACKAGE_VERSION}.

 -- ${CPACK_DEBIAN_PACKAGE_MAINTAINER}  ${date}
")
execute_process(COMMAND gzip -9 --no-name --force ${documents}/changelog COMMAND_ERROR_IS_FATAL ANY)
