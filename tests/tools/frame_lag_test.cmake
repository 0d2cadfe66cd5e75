# Tests that v3dctl verify --images names a camera whose images are one pulse late, although the ledger has no fault, and a
# camera that was displaced by 3 pixels since the calibration. Run by cmake -P with V3DCTL, V3D_SIM and WORK.
include(${CMAKE_CURRENT_LIST_DIR}/displace.cmake)
file(REMOVE_RECURSE ${WORK})
file(WRITE ${WORK}/faults.toml "[[fault]]\ncamera = \"cam03\"\npulse = 0\nkind = \"late\"\npulses = 1\n")
function(expect_verdict take wanted_status pattern)
  execute_process(COMMAND ${V3D_SIM} take ${WORK}/${take} --frames 50 --cameras 8 --size 320x240 ${ARGN}
    RESULT_VARIABLE status ERROR_VARIABLE err)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "v3d-sim: ${err}")
  endif()
  execute_process(COMMAND ${V3DCTL} verify ${WORK}/${take} --images
    RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT status EQUAL wanted_status OR NOT out MATCHES "${pattern}")
    message(SEND_ERROR "${take}: status ${status}, want ${wanted_status} and ${pattern}: ${out}${err}")
  endif()
  string(REGEX MATCHALL "frame lag" named "${out}")
  list(LENGTH named count)
  if(count GREATER 1)
    message(SEND_ERROR "${take}: more than one camera was named: ${out}")
  endif()
endfunction()
expect_verdict(in-sync 0 "commanded, 50 sensed\ntake in-sync: complete")
expect_verdict(late 3 "cam03: frame lag, 1 pulse late.*take late: complete" --faults ${WORK}/faults.toml)

displace_camera(${WORK}/in-sync/calib.toml cam03 -3)
execute_process(COMMAND ${V3DCTL} verify ${WORK}/in-sync --images
  RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
if(NOT status EQUAL 3 OR NOT out MATCHES "cam03: displaced since its calibration: its silhouettes are shifted by [23].[0-9] pixels")
  message(SEND_ERROR "displaced: status ${status}: ${out}${err}")
endif()
file(REMOVE_RECURSE ${WORK})
