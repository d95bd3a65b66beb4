# Helpers that keep every module's CMakeLists.txt down to what is particular to it.
include_guard()

# Warnings are ours alone: private to our targets, never exported.
add_library(piecework_warnings INTERFACE)
add_library(piecework::warnings ALIAS piecework_warnings)
target_compile_options(piecework_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor
  -Wold-style-cast -Wcast-qual -Woverloaded-virtual
  -Wno-missing-field-initializers  # designated initialisers name what they set
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)  # GCC 12 sees overlaps in string concatenation (its bug 105651)

# Reproducible bits: no fused contraction that a compiler may or may not choose.
add_library(piecework_build INTERFACE)
add_library(piecework::build ALIAS piecework_build)
target_compile_options(piecework_build INTERFACE -ffp-contract=off)

# piecework_module(NAME name SOURCES ... HEADERS ... PUBLIC libs... PRIVATE libs...)
# A static library piecework::<name> from the current folder of src/piecework/.
function(piecework_module)
  cmake_parse_arguments(M "" "NAME" "SOURCES;HEADERS;PUBLIC;PRIVATE" ${ARGN})
  add_library(piecework_${M_NAME} STATIC ${M_SOURCES})
  add_library(piecework::${M_NAME} ALIAS piecework_${M_NAME})
  set_target_properties(piecework_${M_NAME} PROPERTIES EXPORT_NAME ${M_NAME} FOLDER src)
  target_compile_features(piecework_${M_NAME} PUBLIC cxx_std_20)
  target_sources(piecework_${M_NAME}
    PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR}/src FILES ${M_HEADERS})
  target_link_libraries(piecework_${M_NAME}
    PUBLIC ${M_PUBLIC}
    PRIVATE ${M_PRIVATE} $<BUILD_INTERFACE:piecework::warnings> $<BUILD_INTERFACE:piecework::build>)
endfunction()

# piecework_test(NAME name SOURCES ... LIBS ... [LABEL unit|scene|slow])
# One executable of GoogleTest cases, run by ctest under the label (default unit).
function(piecework_test)
  if(NOT PIECEWORK_BUILD_TESTS)
    return()
  endif()
  cmake_parse_arguments(T "" "NAME;LABEL" "SOURCES;LIBS" ${ARGN})
  if(NOT T_LABEL)
    set(T_LABEL unit)
  endif()
  add_executable(piecework_${T_NAME}_test ${T_SOURCES})
  set_target_properties(piecework_${T_NAME}_test PROPERTIES FOLDER tests)
  target_link_libraries(piecework_${T_NAME}_test
    PRIVATE ${T_LIBS} GTest::gtest GTest::gtest_main piecework::warnings piecework::build)
  target_compile_definitions(piecework_${T_NAME}_test PRIVATE
    PIECEWORK_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    PIECEWORK_SHARED_DATA="${PROJECT_SOURCE_DIR}/../shared/data"
    PIECEWORK_PROGRAM="${PROJECT_BINARY_DIR}/bin/piecework")
  gtest_discover_tests(piecework_${T_NAME}_test
    PROPERTIES LABELS ${T_LABEL} TIMEOUT 900 DISCOVERY_TIMEOUT 120)
  # All test programs of one label, say `unit_tests`: what the sanitizer runs build.
  if(NOT TARGET ${T_LABEL}_tests)
    add_custom_target(${T_LABEL}_tests)
  endif()
  add_dependencies(${T_LABEL}_tests piecework_${T_NAME}_test)
endfunction()
