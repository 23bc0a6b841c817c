# nodal_module(NAME SOURCES a.cpp ... SEES module ... PACKAGES package ... [EXECUTABLE])
#
# One folder, one library. SEES is the module's whole include list: a header of a module that is not named
# there is not on the compiler's path, because every module's headers are reached through a folder of links
# that holds nothing else. A header that includes another module's header makes its users name both.
#
# With EXECUTABLE the module is a program called NAME (OUTPUT renames the file).
function(nodal_module name)
  cmake_parse_arguments(ARG "EXECUTABLE" "OUTPUT" "SOURCES;SEES;PACKAGES" ${ARGN})
  file(RELATIVE_PATH folder ${CMAKE_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})

  set(view ${CMAKE_BINARY_DIR}/sees/${name})
  file(GLOB headers CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.h)
  file(REMOVE_RECURSE ${view})
  file(MAKE_DIRECTORY ${view}/${folder})
  foreach(header IN LISTS headers)
    get_filename_component(file ${header} NAME)
    file(CREATE_LINK ${header} ${view}/${folder}/${file} SYMBOLIC)
  endforeach()

  set(reach ${view})
  set(links)
  foreach(seen IN LISTS ARG_SEES)
    list(APPEND reach ${CMAKE_BINARY_DIR}/sees/${seen})
    list(APPEND links ${seen})
  endforeach()
  foreach(package IN LISTS ARG_PACKAGES)
    list(APPEND links nodal_package_${package})
  endforeach()

  if(NOT ARG_SOURCES)
    add_library(${name} INTERFACE)
    target_link_libraries(${name} INTERFACE ${links})
    return()
  endif()
  if(ARG_EXECUTABLE)
    add_executable(${name} ${ARG_SOURCES})
    if(ARG_OUTPUT)
      set_target_properties(${name} PROPERTIES OUTPUT_NAME ${ARG_OUTPUT})
    endif()
  else()
    add_library(${name} STATIC ${ARG_SOURCES})
  endif()
  target_include_directories(${name} PRIVATE ${reach})
  target_link_libraries(${name} PRIVATE nodal_flags ${links})
endfunction()
