# Debian packages, one for each role of a PC: cpack --config build/release/CPackConfig.cmake -B build/packages
# A capture PC needs v3d-capture; the reconstruction PC v3d-recon and, for browsers, v3d-viewer; an operator's PC
# v3d-tools. v3d-common has the common user, group and settings. Libraries for other programs: cmake/library.cmake.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME v3d)
set(CPACK_PACKAGE_CONTACT "V3D <v3d@localhost>")
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_POST_BUILD_SCRIPTS ${CMAKE_SOURCE_DIR}/cmake/sbom.cmake)
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL common capture recon viewer tools import)
if(V3D_INSTALLS_LIBRARIES)
  list(APPEND CPACK_COMPONENTS_ALL lights lib lib-dev decoder decoder-dev blender)
endif()
if(V3D_INSTALLS_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION video)
if(CMAKE_CROSSCOMPILING)
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE arm64)
  # Where dpkg-shlibdeps finds the libraries, and the packages that they belong to (tools/arm64-sysroot).
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS
    ${V3D_SYSROOT}/usr/lib/aarch64-linux-gnu ${V3D_SYSROOT}/lib/aarch64-linux-gnu)
  set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_BINARY_DIR}/cpack_environment.cmake)
  file(WRITE ${CPACK_PROJECT_CONFIG_FILE}
    "set(ENV{DPKG_ADMINDIR} ${V3D_SYSROOT}/var/lib/dpkg)\nset(ENV{DEB_HOST_ARCH} arm64)\n")
endif()
# Permissions of folders by Debian's policy: 0755.
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

# v3d_package(<component> <description> [NAME <package>] [DEPENDS ...] [RECOMMENDS ...] [CONTROL <script>...])
# The default of NAME is v3d-<component>.
function(v3d_package component description)
  cmake_parse_arguments(ARG "" "NAME" "DEPENDS;RECOMMENDS;CONTROL" ${ARGN})
  if(NOT ARG_NAME)
    set(ARG_NAME v3d-${component})
  endif()
  string(TOUPPER ${component} key)
  list(JOIN ARG_DEPENDS ", " depends)
  list(JOIN ARG_RECOMMENDS ", " recommends)
  set(CPACK_DEBIAN_${key}_PACKAGE_NAME ${ARG_NAME} PARENT_SCOPE)
  set(CPACK_COMPONENT_${key}_DESCRIPTION "${description}" PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_DEPENDS "${depends}" PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_RECOMMENDS "${recommends}" PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_CONTROL_EXTRA "${ARG_CONTROL}" PARENT_SCOPE)
endfunction()

set(common "v3d-common (= ${PROJECT_VERSION})")
set(daemon_scripts ${CMAKE_SOURCE_DIR}/systemd/daemon/postinst ${CMAKE_SOURCE_DIR}/systemd/daemon/prerm)
v3d_package(common "V3D studio: user, device and network settings"
  DEPENDS systemd udev procps
  CONTROL ${CMAKE_SOURCE_DIR}/systemd/postinst)
v3d_package(capture "V3D studio: daemon of a capture PC, cameras and trigger"
  DEPENDS ${common} RECOMMENDS rsync openssh-server CONTROL ${daemon_scripts})
v3d_package(lights "V3D studio: lamps on DMX, for a capture PC with OLA's daemon"
  DEPENDS "v3d-capture (= ${PROJECT_VERSION})" RECOMMENDS ola)
v3d_package(recon "V3D studio: daemon of the reconstruction PC"
  DEPENDS ${common} RECOMMENDS rsync openssh-server CONTROL ${daemon_scripts})
v3d_package(viewer "V3D studio: the studio and its takes in a browser"
  DEPENDS ${common} RECOMMENDS v3d-tools CONTROL ${daemon_scripts})
v3d_package(tools "V3D studio: v3dctl for operators, v3d-sim for rehearsals"
  DEPENDS ${common} RECOMMENDS rsync openssh-client ffmpeg)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS "default-jre, liblcm-java, libjchart2d-java")
v3d_package(import "V3D studio: images and videos (v3dctl import, v3dctl calibrate)"
  DEPENDS "v3d-tools (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_COMMON_PACKAGE_ARCHITECTURE all)
set(series ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
v3d_package(lib "V3D: library for the reconstruction of 3D video" NAME libv3d${series})
v3d_package(lib-dev "V3D: headers of the library for reconstruction" NAME libv3d-dev
  DEPENDS "libv3d${series} (= ${PROJECT_VERSION})" libeigen3-dev libtbb-dev libexpected-dev)
v3d_package(decoder "V3D: decoder of compact frames and motion files, in C" NAME libv3d-decoder2)
v3d_package(decoder-dev "V3D: header of the decoder of compact frames" NAME libv3d-decoder-dev
  DEPENDS "libv3d-decoder2 (= ${PROJECT_VERSION})")
if(V3D_INSTALLS_PYTHON)
  math(EXPR python_next_minor "${Python_VERSION_MINOR} + 1")
endif()
v3d_package(python "V3D: takes in Python" NAME python3-v3d
  DEPENDS "python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR})"
    "python3 (<< ${Python_VERSION_MAJOR}.${python_next_minor})" python3-numpy)
v3d_package(blender "V3D: import of takes into Blender" NAME v3d-blender
  DEPENDS "libv3d-decoder2 (= ${PROJECT_VERSION})" blender python3-numpy)
set(CPACK_DEBIAN_BLENDER_PACKAGE_ARCHITECTURE all)

# The target v3d_packaged builds what the packages hold.
set(packaged v3d-captured v3d-recond v3d-viewd v3dctl v3d-sim v3d_viewer_page v3d_player)
if(NOT V3D_PROGRAMS_ONLY)
  list(APPEND packaged v3dctl-plan v3dctl-calibrate v3dctl-import v3d_jar)
endif()
if(V3D_INSTALLS_LIBRARIES)
  list(APPEND packaged v3d-lights v3d v3ddecoder)
endif()
if(V3D_INSTALLS_PYTHON)
  list(APPEND packaged v3d_python)
endif()
if(NOT V3D_SANITIZE)  # those have no page
  add_custom_target(v3d_packaged)
  foreach(target ${packaged})
    if(TARGET ${target})  # without Java there is no v3d_jar
      add_dependencies(v3d_packaged ${target})
    endif()
  endforeach()
endif()
foreach(component ${CPACK_COMPONENTS_ALL})
  string(TOUPPER ${component} key)
  install(FILES ${CMAKE_SOURCE_DIR}/LICENSE RENAME copyright
    DESTINATION share/doc/${CPACK_DEBIAN_${key}_PACKAGE_NAME} COMPONENT ${component})
endforeach()

include(CPack)
