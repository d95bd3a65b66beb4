# piecework::build_info: the header <piecework_build_info.hpp> with what results must name: the git
# revision, whether the tree differed from it, compiler, flags and build type. Written anew at build
# time, touched only when something changed. Include it in .cpp files only.
#
# The same file is the script of that build step (cmake -P).
if(CMAKE_SCRIPT_MODE_FILE)
  set(REVISION unknown)
  set(DIRTY false)
  find_program(GIT git)
  if(GIT)
    execute_process(COMMAND ${GIT} -C ${SOURCE_DIR} rev-parse HEAD
      OUTPUT_VARIABLE head OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
    if(NOT failed)
      set(REVISION ${head})
      execute_process(COMMAND ${GIT} -C ${SOURCE_DIR} status --porcelain --untracked-files=no
        OUTPUT_VARIABLE changes ERROR_QUIET)
      if(changes)
        set(DIRTY true)
      endif()
    endif()
  endif()
  configure_file(${CMAKE_CURRENT_LIST_DIR}/piecework_build_info.hpp.in ${OUTPUT} @ONLY)
  return()
endif()

include_guard(GLOBAL)

string(TOUPPER "${CMAKE_BUILD_TYPE}" _config)
string(STRIP "${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${_config}} -ffp-contract=off" _flags)
set(_dir ${PROJECT_BINARY_DIR}/build_info)
add_custom_target(piecework_build_info_header
  COMMAND ${CMAKE_COMMAND} "-DSOURCE_DIR=${PROJECT_SOURCE_DIR}"
    "-DOUTPUT=${_dir}/piecework_build_info.hpp" "-DBUILD_TYPE=${CMAKE_BUILD_TYPE}"
    "-DCOMPILER=${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}" "-DFLAGS=${_flags}"
    -P ${CMAKE_CURRENT_LIST_FILE}
  BYPRODUCTS ${_dir}/piecework_build_info.hpp
  COMMENT "Recording revision and flags" VERBATIM)
add_library(piecework_build_info INTERFACE)
add_library(piecework::build_info ALIAS piecework_build_info)
add_dependencies(piecework_build_info piecework_build_info_header)
target_include_directories(piecework_build_info INTERFACE ${_dir})
