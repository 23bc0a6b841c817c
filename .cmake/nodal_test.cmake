# nodal_test(NAME SOURCES a.cpp ... SEES module ... PACKAGES package ... LABELS label ...
#            [TIMEOUT seconds] [SERIAL] [CAMPAIGN Suite.Test ...])
#
# Defines a GoogleTest program; each of its tests is a separate ctest. LABELS gives its kind (unit, conformance, scenario,
# crash, data, tidy, ...): `ninja tests_unit` builds and `ctest -L unit` runs all tests of a kind. Unit tests get the label
# board, too, and run again on a board's processor, unless they have the label host (tests/README.md says which do). Tests
# may include the modules that SEES names. NODAL_SOURCE_DIR is the checkout, NODAL_SHARED_DIR the test data beside it,
# which may be absent.
# CAMPAIGN names tests that take long and whose subject a shorter test has, too (GoogleTest's patterns). They get the label
# campaign, too, and run by `tests/run --campaigns`. Tests of fixed point have the label exact, and always run on a
# board's processor.
find_package(GTest REQUIRED)
include(GoogleTest)
nodal_package(rapidcheck rapidcheck)

function(nodal_test name)
  cmake_parse_arguments(ARG "SERIAL" "TIMEOUT" "SOURCES;SEES;PACKAGES;LABELS;CAMPAIGN" ${ARGN})
  set(test test_${name})
  add_executable(${test} ${ARG_SOURCES})
  if(NODAL_UNITY)
    target_compile_options(${test} PRIVATE -O1)  # tests take little time themselves; what they test has all optimization
  endif()
  target_include_directories(${test} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR})
  set(links)
  foreach(seen IN LISTS ARG_SEES)
    target_include_directories(${test} PRIVATE ${CMAKE_BINARY_DIR}/sees/${seen})
    list(APPEND links ${seen})
  endforeach()
  foreach(package IN LISTS ARG_PACKAGES)
    list(APPEND links nodal_package_${package})
  endforeach()
  target_link_libraries(${test} PRIVATE nodal_flags ${links} GTest::gtest GTest::gtest_main)
  # Only for sources that use them, so that all others compile to the same objects in every checkout and a compiler cache
  # can reuse them.
  set(places "NODAL_SOURCE_DIR=\"${CMAKE_SOURCE_DIR}\"" "NODAL_SHARED_DIR=\"${CMAKE_SOURCE_DIR}/../shared\""
    "NODAL_BIN_DIR=\"${CMAKE_RUNTIME_OUTPUT_DIRECTORY}\"")
  foreach(source IN LISTS ARG_SOURCES)
    file(STRINGS ${source} asks REGEX "NODAL_(SOURCE|SHARED|BIN)_DIR" LIMIT_COUNT 1)
    if(asks AND NODAL_UNITY)
      target_compile_definitions(${test} PRIVATE ${places})  # a source with definitions of its own is in no batch
    elseif(asks)
      set_source_files_properties(${source} PROPERTIES COMPILE_DEFINITIONS "${places}")
    endif()
  endforeach()
  if("unit" IN_LIST ARG_LABELS AND NOT "host" IN_LIST ARG_LABELS)
    list(APPEND ARG_LABELS board)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 180)
  endif()
  list(JOIN ARG_LABELS " " labels)  # one property; gtest_discover_tests takes a list apart
  set(properties TIMEOUT ${ARG_TIMEOUT} LABELS "${labels}")
  if(CMAKE_CROSSCOMPILING)
    list(APPEND properties ENVIRONMENT "RC_PARAMS=max_success=20")  # cases of a property, 100 otherwise: emulation is slow
  endif()
  if(ARG_SERIAL)
    list(APPEND properties RUN_SERIAL TRUE)
  endif()
  foreach(label IN LISTS ARG_LABELS)
    if(NOT TARGET tests_${label})
      add_custom_target(tests_${label})
    endif()
    add_dependencies(tests_${label} ${test})
  endforeach()
  set(discover ${test} TEST_PREFIX "${name}/" DISCOVERY_TIMEOUT 60)
  if(ARG_CAMPAIGN)
    list(JOIN ARG_CAMPAIGN ":" campaign)
    gtest_discover_tests(${discover} TEST_LIST ${test}_campaign TEST_FILTER "${campaign}"
      PROPERTIES ${properties} LABELS "${labels} campaign")
    gtest_discover_tests(${discover} TEST_FILTER "-${campaign}" PROPERTIES ${properties})
  else()
    gtest_discover_tests(${discover} PROPERTIES ${properties})
  endif()
endfunction()
