# Runs after cpack: writes v3d-packages.spdx.json, the bill of materials of the packages, and their licences beside them.
list(GET CPACK_PACKAGE_FILES 0 first)
get_filename_component(folder ${first} DIRECTORY)
execute_process(
  COMMAND ${CMAKE_CURRENT_LIST_DIR}/../tools/sbom --name v3d-packages-${CPACK_PACKAGE_VERSION} --deb ${CPACK_PACKAGE_FILES}
          --sources ${CMAKE_CURRENT_LIST_DIR}/.. --out ${folder}/v3d-packages.spdx.json
  COMMAND_ERROR_IS_FATAL ANY)
