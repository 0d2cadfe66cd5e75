# knock(<calib.toml> <camera> <pixels>): the camera, of 320x240, was pushed after it was calibrated; its image lies so many
# pixels farther to the right than it did.
function(knock calib camera pixels)
  file(READ ${calib} text)
  set(lens "(name = '${camera}'[^[]+[[]320, 240[]]\nmatrix = [[][[][0-9.]+, 0.0, )([0-9]+)")
  if(NOT text MATCHES "${lens}")
    message(FATAL_ERROR "no lens of ${camera} in ${text}")
  endif()
  math(EXPR column "${CMAKE_MATCH_2} - ${pixels}")
  string(REGEX REPLACE "${lens}" "\\1${column}" text "${text}")
  file(WRITE ${calib} "${text}")
endfunction()
