# Installs piecework::core, graph and global: archives, public headers, and the package Piecework for
# find_package(). Everything else of Piecework stays where it was built, but for the program.
if(NOT PIECEWORK_INSTALL)
  return()
endif()
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(_package ${CMAKE_INSTALL_LIBDIR}/cmake/Piecework)

install(TARGETS piecework_core piecework_graph piecework_global EXPORT PieceworkTargets
  ARCHIVE FILE_SET HEADERS)
install(EXPORT PieceworkTargets NAMESPACE piecework:: DESTINATION ${_package})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/PieceworkConfig.cmake.in
  ${PROJECT_BINARY_DIR}/PieceworkConfig.cmake INSTALL_DESTINATION ${_package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/PieceworkConfigVersion.cmake
  COMPATIBILITY SameMajorVersion)
# Archives do not hold what they call in METIS and OpenBLAS: who links them has to find both.
install(FILES
  ${PROJECT_BINARY_DIR}/PieceworkConfig.cmake ${PROJECT_BINARY_DIR}/PieceworkConfigVersion.cmake
  ${CMAKE_CURRENT_LIST_DIR}/FindMETIS.cmake ${CMAKE_CURRENT_LIST_DIR}/FindOpenBLASControl.cmake
  DESTINATION ${_package})
