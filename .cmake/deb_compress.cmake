# CPack runs this on the files of a package: manual pages and changelogs are compressed, as Debian's policy requires.
file(GLOB_RECURSE files ${CPACK_TEMPORARY_DIRECTORY}/*.1 ${CPACK_TEMPORARY_DIRECTORY}/*.8 ${CPACK_TEMPORARY_DIRECTORY}/changelog*)
foreach(file IN LISTS files)
  execute_process(COMMAND gzip -9nf ${file} COMMAND_ERROR_IS_FATAL ANY)
endforeach()
