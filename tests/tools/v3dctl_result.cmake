# Runs v3dctl and checks what it returns. Included by scripts that cmake -P runs with V3DCTL.

# v3dctl ARGS...: sets status, out, err.
macro(v3dctl)
  execute_process(COMMAND ${V3DCTL} ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE err)
endmacro()
function(expect text pattern)
  if(NOT text MATCHES "${pattern}")
    message(SEND_ERROR "expected ${pattern}, got (status ${status}): ${out}${err}")
  endif()
endfunction()
function(expect_status wanted)
  if(NOT status EQUAL wanted)
    message(SEND_ERROR "expected status ${wanted}, got ${status}: ${out}${err}")
  endif()
endfunction()
