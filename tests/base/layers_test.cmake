# Configures a small project with the real cmake/layers.cmake:
# - capture linked to base must pass;
# - capture linked to recon must fail with a message that contains both names;
# - an #include of a layer that is not linked must not compile;
# - a program that links a layer must have a rule.
function(configure_with link include_line result_variable output_variable)
  file(REMOVE_RECURSE ${WORK})
  foreach(layer base recon capture)
    file(WRITE ${WORK}/${layer}/${layer}.h "#pragma once\n")
    file(WRITE ${WORK}/${layer}/${layer}.cc "#include \"${layer}/${layer}.h\"\nint ${layer}_symbol;\n")
    file(WRITE ${WORK}/${layer}/CMakeLists.txt "v3d_layer(${layer} SOURCES ${layer}.cc)\n")
  endforeach()
  file(APPEND ${WORK}/capture/capture.cc "${include_line}\n")
  file(WRITE ${WORK}/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)\nproject(layers CXX)\n"
    "include(${SOURCE}/cmake/layers.cmake)\n"
    "add_subdirectory(base)\nadd_subdirectory(recon)\nadd_subdirectory(capture)\n"
    "target_link_libraries(v3d_capture PUBLIC ${link})\n${ARGN}v3d_check_layers()\n")
  execute_process(COMMAND ${CMAKE_COMMAND} -S ${WORK} -B ${WORK}/build RESULT_VARIABLE result
    OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(result EQUAL 0)
    execute_process(COMMAND ${CMAKE_COMMAND} --build ${WORK}/build RESULT_VARIABLE result
      OUTPUT_VARIABLE output ERROR_VARIABLE output)
  endif()
  set(${result_variable} ${result} PARENT_SCOPE)
  set(${output_variable} "${output}" PARENT_SCOPE)
endfunction()

configure_with(v3d_base "#include \"base/base.h\"" result output)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "capture may use base, but the build failed: ${output}")
endif()
configure_with(v3d_recon "" result output)
if(result EQUAL 0 OR NOT output MATCHES "layer 'capture' may not use layer 'recon'")
  message(FATAL_ERROR "capture links recon, but the configuration did not fail with the expected message: ${output}")
endif()
configure_with(v3d_base "#include \"recon/recon.h\"" result output)
if(result EQUAL 0 OR NOT output MATCHES "recon/recon.h")
  message(FATAL_ERROR "capture includes recon/recon.h, but the build did not fail with the expected message: ${output}")
endif()
configure_with(v3d_base "" result output
  "add_executable(stranger capture/capture.cc)\ntarget_link_libraries(stranger PRIVATE v3d_capture)\n")
if(result EQUAL 0 OR NOT output MATCHES "'stranger' uses layer 'capture', but has no rule")
  message(FATAL_ERROR "'stranger' has no rule, but the configuration did not fail with the expected message: ${output}")
endif()
