# The Debian libraries that Nodal uses, each as a target nodal_package_NAME that a module requests with PACKAGES NAME.
# Header-only libraries outside /usr/include need a target, too, so that SEES and PACKAGES name everything that a module
# can include.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)

function(nodal_package name)
  add_library(nodal_package_${name} INTERFACE)
  target_link_libraries(nodal_package_${name} INTERFACE ${ARGN})
endfunction()

function(nodal_pkgconfig_package name)
  pkg_check_modules(NODAL_${name} REQUIRED IMPORTED_TARGET GLOBAL ${ARGN})
  nodal_package(${name} PkgConfig::NODAL_${name})
endfunction()

nodal_package(threads Threads::Threads)
nodal_pkgconfig_package(eigen eigen3)
nodal_pkgconfig_package(turbojpeg libturbojpeg)
nodal_pkgconfig_package(png libpng)
nodal_pkgconfig_package(tiff libtiff-4)
# LGPL-3: linked dynamically. Debian's pkg-config names the shared library.
nodal_pkgconfig_package(heif libheif)
nodal_pkgconfig_package(webp libwebp)
nodal_pkgconfig_package(lcms lcms2)
nodal_pkgconfig_package(pugixml pugixml)
# LGPL-2.1: linked dynamically. Debian's pkg-config names the shared library.
nodal_pkgconfig_package(exif libexif)
# LGPL-2.1: linked dynamically. Debian's pkg-config names the shared library.
nodal_pkgconfig_package(microhttpd libmicrohttpd)
# LGPL-2.1: linked dynamically. Debian's pkg-config names the shared library.
nodal_pkgconfig_package(qrencode libqrencode)
nodal_pkgconfig_package(crypto libcrypto)
nodal_pkgconfig_package(fmt fmt)
nodal_pkgconfig_package(spdlog spdlog)
nodal_pkgconfig_package(protobuf protobuf-lite)
nodal_pkgconfig_package(seccomp libseccomp)
nodal_pkgconfig_package(zlib zlib)
nodal_pkgconfig_package(xxhash libxxhash)
nodal_pkgconfig_package(deflate libdeflate)
# LGPL-2.1: linked dynamically. Debian's pkg-config names the shared library.
nodal_pkgconfig_package(gpiod libgpiod>=1.6 libgpiod<3)
# LGPL-2.1: linked dynamically. Debian's pkg-config names the shared library.
nodal_pkgconfig_package(dc1394 libdc1394-2)
nodal_pkgconfig_package(usb libusb-1.0)
# Debian's yaml-cpp development files can be installed for one architecture only: their headers serve all architectures,
# and a cross build links the library file directly.
find_library(NODAL_YAML_LIBRARY NAMES yaml-cpp libyaml-cpp.so.0.7 libyaml-cpp.so.0.8 REQUIRED)
nodal_package(yaml ${NODAL_YAML_LIBRARY})
nodal_package(json)      # nlohmann-json: headers in /usr/include
nodal_package(toml)      # toml++: headers in /usr/include
nodal_package(cli)       # CLI11: headers in /usr/include
# VLFeat (BSD-2) has no pkg-config file.
find_library(NODAL_VLFEAT_LIBRARY NAMES vl REQUIRED)
nodal_package(vlfeat ${NODAL_VLFEAT_LIBRARY})
find_program(PROTOC protoc REQUIRED)
