# nodal_documents(PACKAGE FILE...): the pages that a Debian package installs in share/doc/PACKAGE, side by side.
#
# Links between them are made to fit; of a link to a file of the source tree that the package has not, the text stays.
# tests/packages/contents checks that no link leads nowhere.
function(nodal_documents package)
  set(folder ${CMAKE_BINARY_DIR}/debian/${package}/pages)
  # A script of sed. A link to a page of the package is marked by ://, so that the edit of all other local links leaves it.
  set(edits "")
  foreach(page IN LISTS ARGN)
    get_filename_component(name ${page} NAME)
    string(APPEND edits "s@\\]\\(([^():]*/)?${name}@](://${name}@g\n")
  endforeach()
  string(APPEND edits "s@!?\\[([^]]*)\\]\\([^():#][^():]*\\)@\\1@g\ns@\\]\\(://@](@g\n")
  file(WRITE ${folder}/../pages.sed "${edits}")
  file(MAKE_DIRECTORY ${folder})
  foreach(page IN LISTS ARGN)
    get_filename_component(name ${page} NAME)
    execute_process(COMMAND sed -E -f ${folder}/../pages.sed ${CMAKE_SOURCE_DIR}/${page} OUTPUT_FILE ${folder}/${name}
      COMMAND_ERROR_IS_FATAL ANY)
    set_property(DIRECTORY ${CMAKE_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/${page})
    install(FILES ${folder}/${name} DESTINATION share/doc/${package} COMPONENT ${package})
  endforeach()
endfunction()
