# Debian packages: `cmake --build build/release --target packages` writes nodald, nodal and nodal-web to build/release/packages, and
# the same with build/arm64 those for a 64-bit ARM board. Each contains what the install() lines of the component of its name
# install. tests/packages/run installs them into a fresh Debian.
set(NODAL_MAINTAINER "Nodal maintainers <maintainers@nodal.invalid>" CACHE STRING "Maintainer of the Debian packages")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME nodal)
set(CPACK_PACKAGE_VENDOR Nodal)
set(CPACK_PACKAGE_CONTACT ${NODAL_MAINTAINER})
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_COMPONENTS_ALL nodald nodal nodal-web)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEB_COMPONENT_INSTALL ON)

if(CMAKE_SYSTEM_PROCESSOR STREQUAL aarch64)
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE arm64)
else()
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE amd64)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)

set(CPACK_DEBIAN_NODALD_PACKAGE_NAME nodald)
set(CPACK_DEBIAN_NODALD_PACKAGE_SECTION video)
# For its user and groups (systemd-sysusers) and the unit.
set(CPACK_DEBIAN_NODALD_PACKAGE_DEPENDS systemd)
set(CPACK_DEBIAN_NODALD_PACKAGE_SUGGESTS "nodal, openssh-server")
set(CPACK_DEBIAN_NODALD_PACKAGE_CONTROL_EXTRA
  ${CMAKE_SOURCE_DIR}/firmware/daemon/debian/postinst ${CMAKE_SOURCE_DIR}/firmware/daemon/debian/prerm
  ${CMAKE_SOURCE_DIR}/firmware/daemon/debian/postrm)
set(CPACK_DEBIAN_NODALD_DESCRIPTION "daemon of a multi-head camera that films the full sphere
nodald runs on the board of a rig of 2 to 16 camera heads. It sets every head's
exposure, drives the genlock, captures the heads and blends every set of frames
into one picture of the full sphere, the raymap, which it sends to hosts.")

set(CPACK_DEBIAN_NODAL_PACKAGE_NAME nodal)
set(CPACK_DEBIAN_NODAL_PACKAGE_SECTION video)
# ffmpeg: for films; started as a program, never linked.
set(CPACK_DEBIAN_NODAL_PACKAGE_RECOMMENDS "ffmpeg, openssh-client")
# For `nodal look --open`.
set(CPACK_DEBIAN_NODAL_PACKAGE_SUGGESTS xdg-utils)
set(CPACK_DEBIAN_NODAL_DESCRIPTION "command line for multi-head cameras that film the full sphere
nodal watches and sets a rig that runs nodald, here or over ssh, calibrates and
registers its heads, and pulls raymaps, pictures of the full sphere. Without a
rig it makes spheres of pictures alone, or by a calibration or a project of
PTGui or Hugin.")

set(CPACK_DEBIAN_NODAL-WEB_PACKAGE_NAME nodal-web)
set(CPACK_DEBIAN_NODAL-WEB_PACKAGE_SECTION video)
# For its user and groups (systemd-sysusers) and the units.
set(CPACK_DEBIAN_NODAL-WEB_PACKAGE_DEPENDS systemd)
# nginx listens as soon as it is installed, so that it is not installed unasked: only recommended packages would be.
set(CPACK_DEBIAN_NODAL-WEB_PACKAGE_SUGGESTS "nginx, nodald")
set(CPACK_DEBIAN_NODAL-WEB_PACKAGE_CONTROL_EXTRA
  ${CMAKE_SOURCE_DIR}/host_tool/web/program/debian/postinst ${CMAKE_SOURCE_DIR}/host_tool/web/program/debian/prerm
  ${CMAKE_SOURCE_DIR}/host_tool/web/program/debian/postrm)
set(CPACK_DEBIAN_NODAL-WEB_DESCRIPTION "page of a multi-head camera for phones and tablets
nodal-web shows the live sphere of a rig that runs nodald to phones, tablets and
computers that were paired with it, and lets those that may operate the rig
record, set exposure and download takes. A web server in front of it ends TLS.
Nothing listens before somebody enables it.")

# The user's pages; those of developers stay in the source tree.
include(documents)
file(GLOB host_pages RELATIVE ${CMAKE_SOURCE_DIR} CONFIGURE_DEPENDS host_tool/*.md)
list(FILTER host_pages EXCLUDE REGEX "README.md$")
nodal_documents(nodal ${host_pages} .github/QUESTIONS.md .github/COMPARISON.md firmware/HARDWARE.md firmware/RIG.md
  protocol/CALIBRATION.md protocol/TAKE.md stitch/interchange/FIELDS.md)
nodal_documents(nodald firmware/HARDWARE.md firmware/RIG.md protocol/CALIBRATION.md protocol/TAKE.md)

# What Debian's policy requires in every package: licence, changes of the package, changes of the program.
string(TIMESTAMP NODAL_DATE "%a, %d %b %Y %H:%M:%S +0000" UTC)
# What is in nodal that others wrote: its licence, as Debian's format has it (an empty line is a dot).
file(READ host_tool/page/vendor/LICENSE.three licence)
string(REGEX REPLACE "^.*(Permission is hereby.*[^\n])\n*$" "\\1" licence "${licence}")
string(REPLACE "\n" "\n " licence "${licence}")
string(REPLACE "\n \n" "\n .\n" licence "${licence}")
set(NODAL_FOREIGN_nodald "")
set(NODAL_FOREIGN_nodal "
Files: host_tool/page/vendor/viewer.js
Copyright: 2010-2026 three.js authors
License: Expat
 ${licence}
")
set(NODAL_FOREIGN_nodal-web "${NODAL_FOREIGN_nodal}")
foreach(package nodald nodal nodal-web)
  set(NODAL_FOREIGN "${NODAL_FOREIGN_${package}}")
  set(documents ${CMAKE_BINARY_DIR}/debian/${package})
  file(CONFIGURE OUTPUT ${documents}/changelog.Debian @ONLY CONTENT
    "${package} (@PROJECT_VERSION@-1) unstable; urgency=medium\n\n  * Changes for users are in changelog.gz.\n\n -- @NODAL_MAINTAINER@  @NODAL_DATE@\n")
  file(CONFIGURE OUTPUT ${documents}/copyright @ONLY CONTENT
"Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: Nodal

Files: *
Copyright: 2026 the Nodal maintainers
License: Apache-2.0
 The full text is in /usr/share/common-licenses/Apache-2.0.
@NODAL_FOREIGN@")
  install(FILES ${documents}/changelog.Debian ${documents}/copyright DESTINATION share/doc/${package} COMPONENT ${package})
  install(FILES .github/CHANGELOG.md DESTINATION share/doc/${package} RENAME changelog COMPONENT ${package})
endforeach()
set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_SOURCE_DIR}/.cmake/deb_compress.cmake)

include(CPack)
add_custom_target(packages COMMAND ${CMAKE_CPACK_COMMAND} --config ${CMAKE_BINARY_DIR}/CPackConfig.cmake
  WORKING_DIRECTORY ${CMAKE_BINARY_DIR} VERBATIM)
add_dependencies(packages nodald nodal nodal_web)
