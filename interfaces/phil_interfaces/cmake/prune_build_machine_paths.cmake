# Wheels of ROS 2 packages export generator targets whose include directories are those of the machine that built
# the wheel (/opt/python/cp3XX-...). CMake refuses targets with directories that do not exist, so they are filtered
# out here, in memory and only if present: with ROS 2 from Debian packages this does nothing.
function(phil_prune_build_machine_paths directory)
  get_property(targets DIRECTORY "${directory}" PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(includes ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(includes MATCHES "/opt/python/cp3")
      list(FILTER includes EXCLUDE REGEX "^/opt/python/cp3")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${includes}")
    endif()
  endforeach()
endfunction()

phil_prune_build_machine_paths("${CMAKE_CURRENT_SOURCE_DIR}")
