# The decoder as WebAssembly, from the same sources: build/<preset>/codec/v3d_decoder.wasm, with the C interface of
# codec/v3d_decoder.h, malloc and free. codec/v3d_decoder.mjs calls it from JavaScript. It needs clang and the
# WebAssembly libraries of Debian (tools/install-deps).
find_program(WASM_CXX NAMES clang++-14 clang++-19 REQUIRED)  # of Debian 12 and 13
# Memory grows up to the limit of the decoder. The stack lies below all data, so that a stack overflow is a trap.
set(options --target=wasm32-wasi -std=c++20 -O2 -DNDEBUG -msimd128 -fno-exceptions -fno-rtti -ffp-contract=off
  -Wall -Wextra -I${CMAKE_SOURCE_DIR})
set(link -mexec-model=reactor -Wl,--strip-all,--stack-first,-z,stack-size=1048576,--max-memory=2147483648)
foreach(name new free decode frame want_views)
  list(APPEND link -Wl,--export=v3d_decoder_${name})
endforeach()
foreach(name open free segments segment_at surface_of decode)
  list(APPEND link -Wl,--export=v3d_motion_${name})
endforeach()
list(APPEND link -Wl,--export=malloc,--export=free)

foreach(source ${decoder_sources} ${c_sources})
  set(object ${CMAKE_CURRENT_BINARY_DIR}/wasm/${source}.o)
  add_custom_command(OUTPUT ${object} DEPENDS ${source} DEPFILE ${object}.d
    COMMAND ${CMAKE_CXX_COMPILER_LAUNCHER} ${WASM_CXX} ${options} -MD -MF ${object}.d -MT ${object}
            -c ${CMAKE_CURRENT_SOURCE_DIR}/${source} -o ${object}
    COMMENT "WebAssembly: ${source}" VERBATIM)
  list(APPEND objects ${object})
endforeach()
file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/wasm)
set(module ${CMAKE_CURRENT_BINARY_DIR}/v3d_decoder.wasm)
add_custom_command(OUTPUT ${module} DEPENDS ${objects}
  COMMAND ${WASM_CXX} --target=wasm32-wasi -stdlib=libc++ ${link} ${objects} -o ${module}
  COMMENT "WebAssembly: v3d_decoder.wasm" VERBATIM)
add_custom_target(v3d_decoder_wasm ALL DEPENDS ${module})
