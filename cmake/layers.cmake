# The house: which layer may use which. Two walls hold it up:
#   - a layer's headers are reachable only through the include directory of its own target, so that an
#     #include of a layer that is not linked does not compile;
#   - v3d_check_layers() fails the configuration when a layer links one that it may not use.
set(V3D_LAYERS base codec wire take trigger capture recon calib sim daemon)
set(V3D_MAY_USE_base "")
set(V3D_MAY_USE_wire base)
set(V3D_MAY_USE_codec "")
set(V3D_MAY_USE_take base codec wire)
set(V3D_MAY_USE_trigger base)
set(V3D_MAY_USE_capture base)
set(V3D_MAY_USE_recon base codec)
set(V3D_MAY_USE_calib base)
set(V3D_MAY_USE_sim base)
set(V3D_MAY_USE_daemon base codec wire take trigger capture recon)

# v3d_include_as(<target> <name>): the headers beside the target are included as "<name>/header.h".
function(v3d_include_as target name)
  set(include_dir ${CMAKE_BINARY_DIR}/include/${name})
  file(MAKE_DIRECTORY ${include_dir})
  file(CREATE_LINK ${CMAKE_CURRENT_SOURCE_DIR} ${include_dir}/${name} SYMBOLIC)
  target_include_directories(${target} PUBLIC ${include_dir})
endfunction()

# v3d_layer(<layer> SOURCES ... [USES <layer>...] [LINK <public target>...] [PRIVATE <target>...])
# Defines the static library v3d_<layer>; its headers are included as "<layer>/name.h".
function(v3d_layer layer)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LINK;PRIVATE" ${ARGN})
  add_library(v3d_${layer} STATIC ${ARG_SOURCES})
  v3d_include_as(v3d_${layer} ${layer})
  foreach(used ${ARG_USES})
    target_link_libraries(v3d_${layer} PUBLIC v3d_${used})
  endforeach()
  target_link_libraries(v3d_${layer} PUBLIC ${ARG_LINK} PRIVATE ${ARG_PRIVATE})
endfunction()

function(v3d_check_layers)
  foreach(layer ${V3D_LAYERS})
    if(NOT TARGET v3d_${layer})
      continue()
    endif()
    get_target_property(linked v3d_${layer} LINK_LIBRARIES)
    foreach(used ${V3D_LAYERS})
      if(v3d_${used} IN_LIST linked AND NOT used IN_LIST V3D_MAY_USE_${layer})
        message(FATAL_ERROR "layer '${layer}' may not use layer '${used}': it may use: ${V3D_MAY_USE_${layer}}")
      endif()
    endforeach()
  endforeach()
endfunction()

# All that ctest -L unit runs.
add_custom_target(v3d_unit_tests)

# v3d_test(<name> SOURCES ... LINK <target>... [LABELS <label>...])
# A GoogleTest program; every test in it becomes a CTest test with the labels (default: unit). Properties run with
# a fixed seed; RC_PARAMS=seed=N on the program itself tries others. tests/support is included as "support/name.h".
function(v3d_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK;LABELS" ${ARGN})
  if(NOT ARG_LABELS)
    set(ARG_LABELS unit)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  if(unit IN_LIST ARG_LABELS)
    add_dependencies(v3d_unit_tests ${name})
  endif()
  target_link_libraries(${name} PRIVATE ${ARG_LINK} GTest::gtest GTest::gmock GTest::gtest_main rapidcheck)
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR}/tests)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  set(sanitizer)
  if(V3D_SANITIZE STREQUAL thread AND ARG_LINK MATCHES opencv)
    # OpenCV runs loops of its own, whose threads ThreadSanitizer does not see wait for each other.
    set(sanitizer ENVIRONMENT_MODIFICATION "TSAN_OPTIONS=string_append: ignore_noninstrumented_modules=1")
  endif()
  include(GoogleTest)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT 300
    ENVIRONMENT "RC_PARAMS=seed=20090219" ${sanitizer})
endfunction()
