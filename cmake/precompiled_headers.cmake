# Precompiled headers. Most sources include the same parts of the C++ library, of Eigen and of GoogleTest; without this the
# compiler spends half of its time on them. Every source still includes what it uses. tools/tidy checks this
# for sources outside tests: it compiles them without precompiled headers.
option(V3D_PRECOMPILED_HEADERS "Compile headers that most sources include only once" ON)

# v3d_precompiled_headers(<name> HEADERS <header>... LINK <target>... OPTIONS <compiler option>...)
# Defines a set of precompiled headers. OPTIONS: the position-independence option of the targets that use the set; GCC
# requires the same one.
function(v3d_precompiled_headers name)
  cmake_parse_arguments(ARG "" "" "HEADERS;LINK;OPTIONS" ${ARGN})
  if(NOT V3D_PRECOMPILED_HEADERS)
    return()
  endif()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc)  # a precompiled header needs a source
  file(CONFIGURE OUTPUT ${source} CONTENT "")
  add_library(${name} OBJECT ${source})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(${name} PRIVATE ${ARG_OPTIONS})
  v3d_ccache_options(${name})
endfunction()

# What ccache needs to store objects that use a precompiled header (with CCACHE_SLOPPINESS, see CMakeLists.txt).
function(v3d_ccache_options target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE -fpch-preprocess)
  else()
    target_compile_options(${target} PRIVATE "SHELL:-Xclang -fno-pch-timestamp")
  endif()
endfunction()

# v3d_use_precompiled_headers(<target> <name>)
function(v3d_use_precompiled_headers target name)
  if(V3D_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} REUSE_FROM ${name})
    get_target_property(sources ${target} SOURCES)
    list(FILTER sources INCLUDE REGEX "\\.c$")
    set_source_files_properties(${sources} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
    v3d_ccache_options(${target})
  endif()
endfunction()

# For layers. tools/ and tests/ have sets of their own.
v3d_precompiled_headers(v3d_common_headers
  HEADERS
    <algorithm> <array> <atomic> <chrono> <cmath> <condition_variable> <cstdint> <deque> <filesystem> <functional> <map>
    <memory> <mutex> <optional> <set> <span> <string> <string_view> <thread> <utility> <vector>
    <Eigen/Core> <Eigen/Geometry> <tl/expected.hpp>
  LINK Eigen3::Eigen tl::expected
  OPTIONS -fPIC)
