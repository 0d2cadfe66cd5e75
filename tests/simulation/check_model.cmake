# cmake -DWRITE_TRANSITIONS=... -DSPIN=... -DCC=... -DMODEL=... -DDIR=... -DNODES=3 -DPEOPLE=1 -P check_model.cmake
# Makes Spin's verifier of the model with the daemons' transition table, and runs it.
file(MAKE_DIRECTORY ${DIR})
file(COPY ${MODEL} DESTINATION ${DIR})
get_filename_component(model ${MODEL} NAME)
execute_process(COMMAND ${WRITE_TRANSITIONS} promela OUTPUT_FILE ${DIR}/transitions.pml COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${SPIN} -o3 -a -DNODES=${NODES} -DPEOPLE=${PEOPLE} ${model} WORKING_DIRECTORY ${DIR} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CC} -O1 -w -DSAFETY -DCOLLAPSE -DVECTORSZ=2048 -DMEMLIM=1000 -o pan pan.c
  WORKING_DIRECTORY ${DIR} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ./pan -m200000 WORKING_DIRECTORY ${DIR} OUTPUT_VARIABLE report COMMAND_ERROR_IS_FATAL ANY)
message("${report}")
# A search that was cut short has proved nothing.
if(NOT report MATCHES "errors: 0" OR report MATCHES "truncated|out of memory|too small")
  message(FATAL_ERROR "the model breaks a promise; see ${DIR}: ./pan -r or spin -t -p ${model}")
endif()
