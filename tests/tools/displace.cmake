# displace_camera(<calib.toml> <camera> <pixels>): changes the calibration of a 320x240 camera as if the camera had moved
# afterwards: its images are shifted to the right by this number of pixels.
function(displace_camera calib camera pixels)
  file(READ ${calib} text)
  set(lens "(name = '${camera}'[^[]+[[]320, 240[]]\nmatrix = [[][[][0-9.]+, 0.0, )([0-9]+)")
  if(NOT text MATCHES "${lens}")
    message(FATAL_ERROR "no lens of ${camera} in ${text}")
  endif()
  math(EXPR column "${CMAKE_MATCH_2} - ${pixels}")
  string(REGEX REPLACE "${lens}" "\\1${column}" text "${text}")
  file(WRITE ${calib} "${text}")
endfunction()
