# Tests that calibrate refine corrects two cameras with a wrong direction by the silhouettes of a take, with and without
# fitted focal lengths, and keeps a right calibration. Run by cmake -P with V3DCTL, V3D_SIM and WORK.
include(${CMAKE_CURRENT_LIST_DIR}/displace.cmake)
file(REMOVE_RECURSE ${WORK})
set(take ${WORK}/take)
execute_process(COMMAND ${V3D_SIM} take ${take} --frames 16 --rate 3 --cameras 8 --size 320x240
  RESULT_VARIABLE status ERROR_VARIABLE err)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "v3d-sim: ${err}")
endif()

file(COPY_FILE ${take}/calib.toml ${WORK}/displaced.toml)
displace_camera(${WORK}/displaced.toml cam02 5)
displace_camera(${WORK}/displaced.toml cam05 -5)

function(refine calib better_wanted)
  execute_process(COMMAND ${V3DCTL} calibrate refine --take ${take} --calib ${calib} --out ${WORK}/refined.toml --json
    ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT status EQUAL 0 OR NOT EXISTS ${WORK}/refined.toml)
    message(FATAL_ERROR "refine ${calib} ${ARGN}: status ${status}: ${out}${err}")
  endif()
  string(JSON better GET "${out}" better)
  if(NOT better STREQUAL better_wanted)
    message(SEND_ERROR "refine ${calib} ${ARGN}: better is ${better}: ${out}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

refine(${take}/calib.toml OFF)
foreach(extra "" --focal)
  refine(${WORK}/displaced.toml ON ${extra})
  foreach(camera 1 4)
    string(JSON moved GET "${out}" cameras ${camera} moved_px)
    if(NOT moved GREATER 2.5)
      message(SEND_ERROR "${extra}: camera ${camera} moved by ${moved} px of 5: ${out}")
    endif()
  endforeach()
endforeach()
file(REMOVE_RECURSE ${WORK})
