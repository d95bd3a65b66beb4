# OpenBLAS (Debian: libopenblas-dev), for openblas_set_num_threads(1): BLAS never starts
# threads of its own inside our tasks. Defines OpenBLAS::OpenBLAS.
find_library(OpenBLASControl_LIBRARY openblas)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenBLASControl REQUIRED_VARS OpenBLASControl_LIBRARY)
if(OpenBLASControl_FOUND AND NOT TARGET OpenBLAS::OpenBLAS)
  add_library(OpenBLAS::OpenBLAS UNKNOWN IMPORTED)
  set_target_properties(OpenBLAS::OpenBLAS PROPERTIES IMPORTED_LOCATION ${OpenBLASControl_LIBRARY})
endif()
