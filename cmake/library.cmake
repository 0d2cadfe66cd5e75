# Two libraries for other programs, each with a CMake package and a file for pkg-config:
#   libv3d          reconstruction in C++ (recon/pipeline/stages.h): the layers base, codec and recon. Headers in include/v3d.
#                   The interface may change with every minor version of the project; the SONAME changes with it.
#   libv3d-decoder  decoder of compact frames and motion files in C (v3d_decoder.h). The interface is stable: programs that were compiled
#                   with a version of one SONAME run with every later one.
include(CMakePackageConfigHelpers)

# Debian's folders, relative to the prefix.
set(header_folder include)
set(library_folder lib/${CMAKE_LIBRARY_ARCHITECTURE})

set(library_layers core io image geometry config codec recon)
set(library_objects)
foreach(layer ${library_layers})
  list(APPEND library_objects $<TARGET_OBJECTS:v3d_${layer}>)
endforeach()
add_library(v3d SHARED ${library_objects})
target_link_libraries(v3d PRIVATE Eigen3::Eigen PkgConfig::FMT TBB::tbb tl::expected tomlplusplus::tomlplusplus hwy::hwy
  PkgConfig::XXHASH PkgConfig::SPNG PkgConfig::TURBOJPEG meshoptimizer::meshoptimizer -Wl,--no-undefined)
set_target_properties(v3d PROPERTIES LINKER_LANGUAGE CXX VERSION ${PROJECT_VERSION}
  SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})

# v3d_install_library(<target> <package> <runtime component> <development component> <compatibility>)
# Installs the library and its two description files, with the version of the target.
function(v3d_install_library target package runtime development compatibility)
  get_target_property(version ${target} VERSION)
  install(TARGETS ${target}
    LIBRARY DESTINATION ${library_folder} COMPONENT ${runtime} NAMELINK_COMPONENT ${development})
  set(made ${CMAKE_BINARY_DIR}/${package})
  configure_package_config_file(${CMAKE_SOURCE_DIR}/cmake/${package}-config.cmake.in ${made}/${package}-config.cmake
    INSTALL_DESTINATION ${library_folder}/cmake/${package} PATH_VARS header_folder library_folder)
  write_basic_package_version_file(${made}/${package}-config-version.cmake
    VERSION ${version} COMPATIBILITY ${compatibility})
  configure_file(${CMAKE_SOURCE_DIR}/cmake/${package}.pc.in ${made}/${package}.pc @ONLY)
  install(FILES ${made}/${package}-config.cmake ${made}/${package}-config-version.cmake
    DESTINATION ${library_folder}/cmake/${package} COMPONENT ${development})
  install(FILES ${made}/${package}.pc DESTINATION ${library_folder}/pkgconfig COMPONENT ${development})
endfunction()

v3d_install_library(v3d v3d lib lib-dev SameMinorVersion)
install(DIRECTORY base codec recon DESTINATION ${header_folder}/v3d COMPONENT lib-dev
  FILES_MATCHING PATTERN *.h PATTERN *.inc)
install(DIRECTORY examples/reconstruct_images DESTINATION share/doc/libv3d-dev/examples COMPONENT lib-dev)

v3d_install_library(v3ddecoder v3d-decoder decoder decoder-dev SameMajorVersion)
install(FILES codec/v3d_decoder.h DESTINATION ${header_folder} COMPONENT decoder-dev)
install(DIRECTORY examples/decode_frame DESTINATION share/doc/libv3d-decoder-dev/examples COMPONENT decoder-dev)
