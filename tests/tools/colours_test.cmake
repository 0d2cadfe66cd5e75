# Tests the colour calibration: cameras with different colours get a common response, from images of a performer and of
# the floor. The calibration is written, Delta E falls from above 3 to below 2, and the report is a page. Run by cmake -P with V3DCTL,
# V3D_SIM and WORK.
file(REMOVE_RECURSE ${WORK})
function(run_or_fail)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${ARGN}: status ${status}: ${out}${err}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()
set(take ${WORK}/take)
run_or_fail(${V3D_SIM} take ${take} --frames 2 --cameras 8 --size 320x240 --colour-spread 1)
run_or_fail(${V3DCTL} reconstruct ${take} --voxel 20mm --bounds -1.5,-1.5,0,1.5,1.5,2)
run_or_fail(${V3DCTL} calibrate colour --calib ${take}/calib.toml --take ${take} --out ${WORK}/calib.toml
  --report ${WORK}/report.html --json)
string(JSON before GET "${out}" delta_e before)
string(JSON after GET "${out}" delta_e after)
if(NOT before GREATER 3 OR NOT after LESS 2)
  message(SEND_ERROR "Delta E ${before} before, ${after} after")
endif()
file(READ ${WORK}/calib.toml text)
if(NOT text MATCHES "colour_matrix = ")
  message(SEND_ERROR "the calibration has no colour_matrix: ${text}")
endif()
file(READ ${WORK}/report.html text)
if(NOT text MATCHES "Delta;E")
  message(SEND_ERROR "no Delta E in the report")
endif()

# The reconstruction takes the colours from the take's calibration.
file(COPY_FILE ${WORK}/calib.toml ${take}/calib.toml)
run_or_fail(${V3DCTL} reconstruct ${take} --voxel 20mm --bounds -1.5,-1.5,0,1.5,1.5,2)
file(REMOVE_RECURSE ${WORK})
