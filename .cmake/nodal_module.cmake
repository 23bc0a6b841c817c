# nodal_module(NAME SOURCES a.cpp ... PACKAGES package ... [SEES module ...] [EXECUTABLE] [HARDENED] [SEPARATE])
#
# Defines the library of one folder, named after the folder with _ for /. It may include the modules that its folder's
# line in .cmake/includes.txt names. Other headers are not on the compiler's path, because each module's headers are in a
# folder of links of their own. If a header includes another module's header, users of the first must name both.
#
# With EXECUTABLE the module is a program called NAME (OUTPUT renames the file). SEES: for a program, modules in addition
# to its folder's line; for a module of tests/, whose folders have no line, all modules. HARDENED is for code that reads
# data from peers, devices and files: it is compiled with stack protection and checked library calls. Numeric kernels are
# not, because they read only checked tables and their time matters. SEPARATE: no two sources are compiled together, even
# with NODAL_UNITY, because they define the same names for themselves or are compiled for different processors.
set_property(DIRECTORY ${CMAKE_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/.cmake/includes.txt)

# The modules that the line of `folder` names; for a header, the module that contains it.
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

# Keeps a source out of NODAL_UNITY's batches: a program that replaces it, and is linked before its library, then uses
# nothing of its object.
function(nodal_replaceable source)
  get_filename_component(folder ${source} DIRECTORY)
  set_source_files_properties(${CMAKE_SOURCE_DIR}/${source} DIRECTORY ${CMAKE_SOURCE_DIR}/${folder}
    PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

function(nodal_module name)
  cmake_parse_arguments(ARG "EXECUTABLE;HARDENED;SEPARATE" "OUTPUT" "SOURCES;SEES;PACKAGES" ${ARGN})
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
  if(ARG_SEPARATE)
    set_target_properties(${name} PROPERTIES UNITY_BUILD OFF)
  endif()
  target_include_directories(${name} PRIVATE ${reach})
  target_link_libraries(${name} PRIVATE nodal_flags ${links})
  if(ARG_HARDENED)
    target_link_libraries(${name} PRIVATE nodal_hardening)
  endif()
endfunction()
