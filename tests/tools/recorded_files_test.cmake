# Tests that a command's result replaces no file of a take. Run by cmake -P with V3DCTL, V3D_SIM and WORK.
file(REMOVE_RECURSE ${WORK})
execute_process(COMMAND ${V3D_SIM} take ${WORK}/kendo-07 --frames 1 --cameras 4 --size 64x48 RESULT_VARIABLE status
  ERROR_VARIABLE err)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "v3d-sim take: ${err}")
endif()
file(COPY ${WORK}/kendo-07/calib.toml DESTINATION ${WORK})
# A reconstruction node lists the repaired pulses during the recording; an edited take has its operations.
file(WRITE ${WORK}/kendo-07/repaired.recon01.txt "0\n")
file(WRITE ${WORK}/kendo-07/edit.json "{}\n")
foreach(name cam01.lcmlog pulses.lcmlog take.toml ledger.toml background/cam01.toml repaired.recon01.txt edit.json)
  file(SHA256 ${WORK}/kendo-07/${name} before)
  execute_process(COMMAND ${V3DCTL} calibrate convert ${WORK}/calib.toml ${WORK}/kendo-07/${name} --to toml
    RESULT_VARIABLE status ERROR_VARIABLE err OUTPUT_QUIET)
  if(NOT status EQUAL 2 OR NOT err MATCHES "^[^\n]*/${name}: is a recorded file of a take[^\n]*\n$")
    message(SEND_ERROR "${name}: status ${status}: ${err}")
  endif()
  file(SHA256 ${WORK}/kendo-07/${name} after)
  if(NOT before STREQUAL after)
    message(SEND_ERROR "${name} was replaced")
  endif()
endforeach()
execute_process(COMMAND ${V3DCTL} calibrate convert ${WORK}/calib.toml ${WORK}/kendo-07/rig.toml --to toml
  RESULT_VARIABLE status ERROR_VARIABLE err OUTPUT_QUIET)
if(NOT status EQUAL 0)
  message(SEND_ERROR "a new file beside the take: status ${status}: ${err}")
endif()
