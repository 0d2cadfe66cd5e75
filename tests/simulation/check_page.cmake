# cmake -DWRITE_TRANSITIONS=... -DPAGE=docs/protocol.md -P check_page.cmake
execute_process(COMMAND ${WRITE_TRANSITIONS} markdown OUTPUT_VARIABLE table COMMAND_ERROR_IS_FATAL ANY)
file(READ ${PAGE} page)
string(FIND "${page}" "${table}" at)
if(at EQUAL -1)
  message(FATAL_ERROR "${PAGE} does not show the table of daemon/control/control.h; insert this:\n${table}")
endif()
