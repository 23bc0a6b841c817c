# Bugs that the swarm must find within 200 seeds. Each is one program: a source of the firmware, copied with one text
# replaced, goes before the library, whose own is then left out. Nothing of it is in what is shipped.
#
# canary(NAME SWARM FILE FROM TO [FILE FROM TO]...)    SWARM finds it: SETS; HOSTILE: its hostile clients, in rigs where
#                                                       nothing else goes wrong; TAKES: the swarm of takes

# The copy of `file` with one text replaced.
function(mutated_copy name file from to result)
  get_filename_component(copy ${file} NAME)
  set(mutated ${CMAKE_CURRENT_BINARY_DIR}/canaries/${name}/${copy})
  add_custom_command(OUTPUT ${mutated} VERBATIM DEPENDS ${CMAKE_SOURCE_DIR}/${file} ${CMAKE_CURRENT_SOURCE_DIR}/mutate.cmake
    COMMAND ${CMAKE_COMMAND} -DIN=${CMAKE_SOURCE_DIR}/${file} -DOUT=${mutated} -DFROM=${from} -DTO=${to}
            -P ${CMAKE_CURRENT_SOURCE_DIR}/mutate.cmake)
  nodal_replaceable(${file})
  set(${result} ${mutated} PARENT_SCOPE)
endfunction()

function(canary name)
  set(swarm ${ARGV1})  # TAKES, HOSTILE or SETS
  set(copies)
  set(i 2)
  while(i LESS ARGC)  # by number, because the texts have semicolons
    math(EXPR at_from "${i} + 1")
    math(EXPR at_to "${i} + 2")
    mutated_copy(${name} ${ARGV${i}} "${ARGV${at_from}}" "${ARGV${at_to}}" mutated)
    list(APPEND copies ${mutated})
    math(EXPR i "${i} + 3")
  endwhile()
  if(swarm STREQUAL "TAKES")
    set(program take_swarm_canary_${name})
    nodal_module(${program} EXECUTABLE SOURCES take_main.cpp ${copies}
      SEES sim_takes ${take_swarm_modules} test_support PACKAGES protobuf SEPARATE)
    set(arguments)
  else()
    set(program swarm_canary_${name})
    nodal_module(${program} EXECUTABLE SOURCES ${copies}
      SEES sim_main ${swarm_modules} sim_hostile sim_swarm PACKAGES protobuf SEPARATE)
    set(arguments --quiet --minutes 10)
    if(swarm STREQUAL "HOSTILE")
      set(arguments --quiet --minutes 2 --hostile)
    endif()
  endif()
  add_test(NAME sim/canary_${name} COMMAND ${program} --canary --seeds 200 ${arguments})
  set_tests_properties(sim/canary_${name} PROPERTIES LABELS sim TIMEOUT 600)
  if(NOT swarm STREQUAL "TAKES")
    set_tests_properties(sim/canary_${name} PROPERTIES PROCESSORS 2)
  endif()
endfunction()

canary(late_frame_taken SETS firmware/capture/capture_sets.cpp
  "if (newest_closed && match->slot <= *newest_closed)" "if (newest_closed && match->slot + 1 < *newest_closed)")
canary(loss_not_counted SETS firmware/capture/capture_head.cpp
  "++report_.counts.losses[static_cast<std::size_t>(reason)]\;"
  "if (reason != LossReason::kDuplicate) ++report_.counts.losses[static_cast<std::size_t>(reason)]\;")
canary(buffer_given_back_early SETS firmware/capture/capture_head.cpp
  "if (!reason) return frame\;" "if (!reason) return port_->release(frame.slot), frame\;")
canary(wrapped_time_believed SETS firmware/capture/capture_sets.cpp
  "return age >= Duration() && age <=" "return age <=" )
canary(old_train_matched SETS firmware/sync/set_clock.cpp
  "if (begin < since_ + kStampsOff) return std::nullopt\;" "")
canary(holdover_called_locked SETS firmware/sync/genlock.cpp
  "Row{kOff, kLost, kHoldover, kHoldover, kLost},                    // pulses overdue"
  "Row{kOff, kLost, kLocked, kHoldover, kLost},")
canary(creeping_head_unnoticed SETS firmware/sync/genlock.cpp
  "&& estimates_in_step(skews.known, pulse_late_us) &&" "&&")
canary(jumping_head_unnoticed SETS firmware/sync/genlock.cpp
  "return raw.width() <= kSafeLimit && estimates_in_step" "return estimates_in_step")
canary(set_waits_for_ever SETS firmware/capture/capture_sets.cpp
  "if (now < due()) break\;" "if (now < due() + Duration::seconds(10)) break\;")
canary(head_not_looked_for SETS firmware/capture/capture_head.cpp
  "constexpr Duration kRetry = Duration::milliseconds(200)\;" "constexpr Duration kRetry = Duration::milliseconds(2600)\;")
canary(calibration_not_synced SETS firmware/storage/durable_file.cpp "if (done) done = disk.sync(handle)\;" "")
canary(told_and_not_kept SETS firmware/calibration/calibration_keeper.cpp
  "const Status kept = store_.put_in_force(done.id, done.signed_generation)\;" "const Status kept{}\;")
canary(raymap_names_the_first SETS firmware/picture/blender.cpp
  "blend_.plan()->id, {}, {}}\;"
  "[this] { static const Sha256 first = blend_.plan()->id\; return first\; }(), {}, {}}\;")
canary(moved_the_wrong_way SETS firmware/sync/aligner.cpp
  "nudges[i] = in_steps(off, limits.step)\;" "nudges[i] = in_steps(-off, limits.step)\;")
canary(asked_taken_for_done SETS firmware/sync/aligner.cpp
  "head.clock.add(frame.mid_exposure - place_of(frame))\;"
  "head.clock.add(frame.mid_exposure - place_of(frame) + frame.nudged - head.requested)\;")
canary(cut_jpeg_blended SETS stitch/decode/frame_decoder.cpp
  "if (fault == DecodeFault::kNone) {" "if (fault != DecodeFault::kOtherSize) {")
canary(field_at_its_frames_time SETS firmware/picture/blender.cpp
  "set_->mid_exposure + set_->second_field\;" "set_->mid_exposure\;")

canary(stuck_reader_holds_the_publisher SETS firmware/picture/encoder.cpp "if (published_.full()) return false\;"
  "for (auto& outlet : outlets_) { if (outlet.full()) return false\; }")

canary(idle_hosts_stay HOSTILE firmware/hosts/admission.cpp "all.size() > most_hosts\;" "all.size() > most_hosts + 100\;")
canary(silent_links_stay HOSTILE firmware/hosts/admission.cpp
  "all.size() > most_strangers\;" "all.size() > most_strangers + 100\;"
  firmware/hosts/host_activity.cpp "if (session.peer_hello() == nullptr && now - since_ > kHelloWithin)"
  "if (session.peer_hello() == nullptr && now - since_ > kSilentFor)")
canary(lossless_pull_holds_the_rig HOSTILE firmware/hosts/publisher.cpp
  "const auto raymap = raymaps_in_.take()\;"
  "for (const auto& client : clients) { for (const auto& [stream, pull] : client->pulls) { const auto counts = client->session().counts(stream)\; if (pull.lossless && counts && counts->pending >= 2) return false\; } } const auto raymap = raymaps_in_.take()\;")
canary(lossless_pull_has_gaps HOSTILE firmware/hosts/publisher.cpp "if (!client.session().offer(stream, item(raymap, pull.coding))) return false\;"
  "if (raymap.info.set % 64 == 0 || !client.session().offer(stream, item(raymap, pull.coding))) return false\;")
canary(log_without_limit HOSTILE firmware/operate/news.cpp "if (bucket.bytes <= 0)" "if (bucket.left_out > 0)")

canary(take_overwritten TAKES
  firmware/record/take_numbers.cpp "std::max(next_take_, highest_ + 1)" "next_take_"
  firmware/record/take_writer.cpp "Status good = disk.make_folder(place.folder)\;"
  "Status good = disk.make_folder(place.folder)\; if (!good && good.error().code == Errc::kExists) { for (const std::string& name : disk.list(place.folder).value_or(std::vector<std::string>())) (void)disk.remove(place.folder + \"/\" + name)\; good = {}\; }")
canary(two_owners TAKES firmware/record/take_shelf.cpp
  "if (const Status claimed = disk_.claim()\; !claimed) return fail(explained(claimed.error()))\;"
  "if (const Status claimed = disk_.claim()\; !claimed && claimed.error().code != Errc::kBusy) return fail(explained(claimed.error()))\;")
canary(rate_of_the_configuration TAKES
  firmware/record/take_keeper.cpp "rate_.rate = start.rate.value_or(config_.rate)\;" "rate_.rate = config_.rate\;"
  firmware/record/segment_writer.cpp "begin.set_rate_numerator(first.rate.numerator)\;"
  "begin.set_rate_numerator(place.rate.numerator)\; begin.set_rate_denominator(place.rate.denominator)\; if (first.sets.empty())")
