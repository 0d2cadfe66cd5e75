# cmake -DWRITE_TRANSITIONS=... -DSPIN=... -DCC=... -DMODEL=... -DDIR=... [-DDEFINES=...] [-DCC_DEFINES=...]
#       [-DPAN_OPTIONS=...] [-DHAS_FAULT=yes] -P check_model.cmake
# Builds Spin's verifier of the model with the daemons' transition table and runs it. With HAS_FAULT, the verifier must find
# an error.
if(NOT EXISTS "${SPIN}")
  message(FATAL_ERROR "spin is not installed, so the model is not checked; try: tools/install-deps")
endif()
file(MAKE_DIRECTORY ${DIR})
file(COPY ${MODEL} ${CMAKE_CURRENT_LIST_DIR}/node.pml DESTINATION ${DIR})
get_filename_component(model ${MODEL} NAME)
execute_process(COMMAND ${WRITE_TRANSITIONS} promela OUTPUT_FILE ${DIR}/transitions.pml COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${SPIN} -o3 -a ${DEFINES} ${model} WORKING_DIRECTORY ${DIR} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CC} -O1 -w -DCOLLAPSE -DVECTORSZ=2048 -DMEMLIM=1000 ${CC_DEFINES} -o pan pan.c
  WORKING_DIRECTORY ${DIR} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ./pan ${PAN_OPTIONS} WORKING_DIRECTORY ${DIR} OUTPUT_VARIABLE report COMMAND_ERROR_IS_FATAL ANY)
message("${report}")
# An incomplete search proves nothing.
if(report MATCHES "truncated|out of memory|too small")
  message(FATAL_ERROR "the search is incomplete: a limit of depth or memory was reached; see ${DIR}")
endif()
if(HAS_FAULT AND report MATCHES "errors: 0")
  message(FATAL_ERROR "the model does not find the injected fault; see ${DIR}")
endif()
if(NOT HAS_FAULT AND NOT report MATCHES "errors: 0")
  message(FATAL_ERROR "the model violates an invariant; see ${DIR}: ./pan -r or spin -t -p ${model}")
endif()
