# What `cmake --install BUILD --component cpp` gives a C++ user: find_package(dualdrive), target dualdrive::core.
include(CMakePackageConfigHelpers)

set(config_dir "${CMAKE_INSTALL_LIBDIR}/cmake/dualdrive")
install(TARGETS dualdrive dualdrive_sundials EXPORT dualdriveTargets
  ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT cpp)
install(DIRECTORY cpp/include/dualdrive
  DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" COMPONENT cpp FILES_MATCHING PATTERN "*.hpp")
install(EXPORT dualdriveTargets NAMESPACE dualdrive:: DESTINATION "${config_dir}" COMPONENT cpp)

configure_package_config_file(cmake/dualdriveConfig.cmake.in dualdriveConfig.cmake
  INSTALL_DESTINATION "${config_dir}")
write_basic_package_version_file(dualdriveConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  "${CMAKE_CURRENT_BINARY_DIR}/dualdriveConfig.cmake"
  "${CMAKE_CURRENT_BINARY_DIR}/dualdriveConfigVersion.cmake"
  DESTINATION "${config_dir}" COMPONENT cpp)
