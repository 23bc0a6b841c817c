# Faults that the targets must find: a target with sources of the program copied and texts in them replaced, before the
# library's own, which are then left out. `tests/fuzz/run --canaries` builds them and counts the executions that each
# needs. The copies are made in every build, so that a text that has changed is noticed.
#
# fuzz_canary(NAME TARGET [ALSO source.cpp ...] [PATCH file from to] ...)
#
# A header may be patched, too: TARGET's own sources and those that ALSO names are compiled with it.
function(fuzz_canary name target)
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/canaries/${name})
  set(mode "")
  set(also)
  set(patched)
  set(commands)
  math(EXPR last "${ARGC} - 1")
  foreach(i RANGE 2 ${last})
    set(word "${ARGV${i}}")
    if(word STREQUAL "ALSO")
      set(mode ALSO)
    elseif(word STREQUAL "PATCH")
      set(mode file)
    elseif(mode STREQUAL "ALSO")
      list(APPEND also ${CMAKE_SOURCE_DIR}/${word})
    elseif(mode STREQUAL "file")
      set(file ${word})
      set(mode from)
    elseif(mode STREQUAL "from")
      string(REPLACE ";" "\;" from "${word}")
      set(mode to)
    else()
      string(REPLACE ";" "\;" to "${word}")
      set(in ${folder}/${file})
      if(NOT in IN_LIST patched)
        list(APPEND patched ${in})
        if(file MATCHES "\\.cpp$" AND NOT file MATCHES "^tests/")
          nodal_replaceable(${file})
        endif()
        set(in ${CMAKE_SOURCE_DIR}/${file})
      endif()
      list(APPEND commands COMMAND ${CMAKE_COMMAND} -DIN=${in} -DOUT=${folder}/${file} "-DFROM=${from}" "-DTO=${to}"
        -P ${CMAKE_SOURCE_DIR}/tests/sim/mutate.cmake)
    endif()
  endforeach()
  set(originals ${patched})
  list(TRANSFORM originals REPLACE "^${folder}" "${CMAKE_SOURCE_DIR}")
  add_custom_command(OUTPUT ${patched} VERBATIM ${commands} DEPENDS ${originals} ${CMAKE_SOURCE_DIR}/tests/sim/mutate.cmake)
  add_custom_target(fuzz_canary_${name}_sources ALL DEPENDS ${patched})

  get_target_property(sources fuzz_${target} SOURCES)
  get_target_property(includes fuzz_${target} INCLUDE_DIRECTORIES)
  get_target_property(libraries fuzz_${target} LINK_LIBRARIES)
  add_executable(fuzz_canary_${name} EXCLUDE_FROM_ALL ${sources} ${also} ${patched})
  set_target_properties(fuzz_canary_${name} PROPERTIES UNITY_BUILD OFF)
  add_dependencies(fuzz_canary_${name} fuzz_canary_${name}_sources)
  target_include_directories(fuzz_canary_${name} PRIVATE ${folder} ${includes})
  target_link_libraries(fuzz_canary_${name} PRIVATE ${libraries})
  if(NODAL_FUZZ)
    target_link_options(fuzz_canary_${name} PRIVATE -fsanitize=fuzzer)
  endif()
endfunction()

# A rate that hangs the rig: its terms are not bounded, and where a frame begins overflows 64 bits.
set(start_of_overflows PATCH protocol/base/units.h
  "static_cast<unsigned __int128>(n) * denominator * 1'000'000'000U / numerator" "n * denominator * 1'000'000'000U / numerator")
fuzz_canary(start_overflows rates ${start_of_overflows})
fuzz_canary(catch_up_unbounded rates
  PATCH hal/sim/trigger.cpp "if (done == kEdgesKept) skip_to(now)" "if (done == ~std::size_t{0}) skip_to(now)")
fuzz_canary(rig_toml_rate_unchecked rates
  PATCH firmware/config/config.cpp "return FrameRate::make(*above, *below)" "return FrameRate{*above, *below}")
set(rate_accepted ALSO tests/sim/trigger.cpp ${start_of_overflows})
fuzz_canary(rate_accepted_from_hosts control ${rate_accepted} PATCH firmware/hosts/wire_commands.cpp
  "start.rate = FrameRate::make(request.rate_numerator(), request.rate_denominator())"
  "if (request.rate_numerator() != 0 && request.rate_denominator() != 0) start.rate = FrameRate{request.rate_numerator(), request.rate_denominator()}")
fuzz_canary(rate_accepted_from_settings settings_file ${rate_accepted} PATCH firmware/operate/settings.cpp
  "start.rate = FrameRate::make(above, below)"
  "if (above != 0 && below != 0) start.rate = FrameRate{above, below}")

# Memory that grows by what requests hold: their unknown fields are not dropped, and a setting is merged into those before.
fuzz_canary(unknown_fields_from_hosts control
  PATCH protocol/session.cpp "drop_unknown_fields(request)" "(void)request"
  PATCH firmware/hosts/wire_commands.cpp "if (request.heads_size() > kMaxHeads) {"
  "static wire::HeadSetRequest all; all.MergeFrom(request); if (request.heads_size() > kMaxHeads) {")

# Memory that grows: the audit log keeps every word of a refusal, and a refusal repeats what the host sent.
fuzz_canary(refusals_kept_whole control
  PATCH firmware/operate/audit_log.cpp "printable(entry.error->message, kMaxAuditText)" "printable(entry.error->message, ~std::size_t{0})"
  PATCH firmware/operate/audit_log.cpp "if (!repeats && kind.quota.used_at(now, kRefill) < kBurst) {" "if (true) {"
  PATCH firmware/operate/audit_log.cpp "if (entries_.size() > kMaxKept) entries_.pop_front()" "(void)0")
