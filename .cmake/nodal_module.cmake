# nodal_module(NAME SOURCES a.cpp ... PACKAGES package ... [SEES module ...] [EXECUTABLE] [HARDENED])
#
# One folder, one library, called as its folder with _ for /. What it may include is its folder's line in
# .cmake/includes.txt: a header of a module that is not named there is not on the compiler's path, because every
# module's headers are reached through a folder of links that holds nothing else. A header that includes another
# module's header makes its users name both.
#
# With EXECUTABLE the module is a program called NAME (OUTPUT renames the file). SEES names what a program sees besides
# its folder's line, and all that a module of tests/ sees, whose folders have no line. HARDENED is for code that reads
# what peers, devices and files say: it is compiled with stack protection and checked library calls. Numeric kernels are
# not, since they read checked tables only and are measured by the millisecond.
set_property(DIRECTORY ${CMAKE_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/.cmake/includes.txt)

# The modules that the line of `folder` names: of a header, the one that holds it.
function(nodal_line_of folder result)
  file(READ ${CMAKE_SOURCE_DIR}/.cmake/includes.txt table)
  string(REGEX REPLACE "\n[ \t]+" " " table "${table}")
  string(REGEX MATCH "(^|\n)${folder}:([^\n]*)" line "${table}")
  if(NOT line)
    message(FATAL_ERROR "${folder} has no line in .cmake/includes.txt")
  endif()
  separate_arguments(seen UNIX_COMMAND "${CMAKE_MATCH_2}")
  list(TRANSFORM seen REPLACE "/[^/]*\\.h$" "")
  list(TRANSFORM seen REPLACE "/" "_")
  list(REMOVE_DUPLICATES seen)
  set(${result} ${seen} PARENT_SCOPE)
endfunction()

function(nodal_module name)
  cmake_parse_arguments(ARG "EXECUTABLE;HARDENED" "OUTPUT" "SOURCES;SEES;PACKAGES" ${ARGN})
  file(RELATIVE_PATH folder ${CMAKE_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  set(sees ${ARG_SEES})
  if(NOT folder MATCHES "^tests/")
    nodal_line_of(${folder} line)
    list(APPEND sees ${line})
    string(REPLACE "/" "_" expected ${folder})
    if(NOT ARG_EXECUTABLE AND (ARG_SEES OR NOT name STREQUAL expected))
      message(FATAL_ERROR "${folder}'s module is called ${expected}, and its SEES is its line in .cmake/includes.txt")
    endif()
  endif()

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
  foreach(seen IN LISTS sees)
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
  if(ARG_HARDENED)
    target_link_libraries(${name} PRIVATE nodal_hardening)
  endif()
endfunction()
