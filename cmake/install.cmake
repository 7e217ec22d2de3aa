# What an installation holds, and the Debian package that is made of it (cpack; ./dev package).
# docs/howto/install.md tells how it is used.
include(GNUInstallDirs)

if(NOT TARGET veneer OR NOT TARGET veneerd)
  return()  # a part of the house, built alone
endif()

install(TARGETS veneer veneerd RUNTIME)
install(FILES etc/systemd/veneerd.service DESTINATION lib/systemd/system)
install(FILES etc/sysusers.d/veneer.conf DESTINATION lib/sysusers.d)
install(DIRECTORY etc/udev/ DESTINATION lib/udev/rules.d)
install(FILES etc/dbus-1/org.veneer.Veneer1.conf DESTINATION share/dbus-1/system.d OPTIONAL)
# The examples, which programs look for beside their own folder (cli/programs.cc).
foreach(examples benches demo obara scenarios studios)
  install(DIRECTORY etc/${examples} DESTINATION share/veneer)
endforeach()
install(FILES README.md LICENSE DESTINATION share/doc/veneer)
install(DIRECTORY docs/ DESTINATION share/doc/veneer PATTERN man EXCLUDE)

# The configuration of the machine is in /etc whatever the prefix of a system's programs is, is never
# written over, and in a trial installation elsewhere stays below its prefix.
install(CODE "
  set(etc \"\${CMAKE_INSTALL_PREFIX}/etc\")
  if(CMAKE_INSTALL_PREFIX MATCHES \"^/usr(/local)?$\")
    set(etc /etc)
  endif()
  if(NOT EXISTS \"\$ENV{DESTDIR}\${etc}/veneer/veneer.toml\")
    file(INSTALL \"${CMAKE_SOURCE_DIR}/etc/veneer.toml\" DESTINATION \"\${etc}/veneer\")
  endif()")

# Manual pages and completion come out of the programs themselves.
set(pages ${CMAKE_BINARY_DIR}/pages)
add_custom_command(
  OUTPUT ${pages}/made
  COMMAND ${CMAKE_COMMAND} -E rm -rf ${pages}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${pages}/man5 ${pages}/man8
  COMMAND veneer manual --quiet ${pages}/man1 > ${pages}/made
  COMMAND veneerd --manual > ${pages}/man8/veneerd.8
  COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_SOURCE_DIR}/docs/man/veneer.toml.5 ${pages}/man5
  COMMAND gzip -9 --no-name --recursive ${pages}/man1 ${pages}/man5 ${pages}/man8
  COMMAND veneer completion bash > ${pages}/veneer
  COMMAND veneer completion fish > ${pages}/veneer.fish
  COMMAND veneer completion zsh > ${pages}/_veneer
  DEPENDS veneer veneerd docs/man/veneer.toml.5
  VERBATIM)
add_custom_target(veneer_pages ALL DEPENDS ${pages}/made)
foreach(section 1 5 8)
  install(DIRECTORY ${pages}/man${section} DESTINATION ${CMAKE_INSTALL_MANDIR})
endforeach()
install(FILES ${pages}/veneer DESTINATION share/bash-completion/completions)
install(FILES ${pages}/veneer.fish DESTINATION share/fish/vendor_completions.d)
install(FILES ${pages}/_veneer DESTINATION share/zsh/vendor-completions)

# The package. Libraries that are linked are found by dpkg-shlibdeps; GL and EGL are loaded by name.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME veneer)
set(CPACK_PACKAGE_VENDOR Veneer)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "make an object look as if it were of another material")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"Veneer drives a projector so that a plain object looks as if it were made of
another material: a bidirectional texture function, shown to a tracked observer
and corrected for projector, surface and room. The package holds the service
veneerd and the program veneer, which measures, fits, calibrates and verifies.")
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "The authors of Veneer <maintainers@veneer.invalid>")
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libegl1, libgl1, systemd | systemd-standalone-sysusers")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "dbus, libgl1-mesa-dri, udev")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "argyll, openmpi-bin, prometheus-node-exporter")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
  ${CMAKE_SOURCE_DIR}/cmake/debian/conffiles ${CMAKE_SOURCE_DIR}/cmake/debian/postinst
  ${CMAKE_SOURCE_DIR}/cmake/debian/prerm ${CMAKE_SOURCE_DIR}/cmake/debian/postrm)
set(CPACK_STRIP_FILES ON)
# Absolute paths, /etc, go into the package too.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
# What Debian wants in every package, and no other installation does.
set(CPACK_INSTALL_SCRIPTS ${CMAKE_SOURCE_DIR}/cmake/debian/documents.cmake)
include(CPack)
