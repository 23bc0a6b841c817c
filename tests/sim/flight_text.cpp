#include "flight_text.h"

#include <fmt/format.h>

#include <array>
#include <variant>

namespace nodal::flight {
namespace {

using namespace firmware;

std::string outcome(const Status& status) { return status ? "" : ", which fails: " + status.error().message; }

std::string head_name(HeadIndex head, const RigConfig& config) {
  return "head " + (head < config.heads.size() ? config.heads[head].name : std::to_string(head));
}

std::string called(const HeadCalled& event) {
  constexpr std::array<std::string_view, HeadCalled::kCalls> kNames = {
      "starts in mode {}",           "stops",
      "gets an exposure of {} ns",   "gets a gain of {} mdB",
      "gets the white balance {:x}", "gets a gamma of {}",
      "is nudged by {} ns"};
  return fmt::format(fmt::runtime(kNames[static_cast<std::size_t>(event.call)]), event.value) + outcome(event.status);
}

std::string delivered(const hal::FrameView& frame) {
  return fmt::format(
      "delivers frame {} in slot {}: mid-exposure {} ns, received {} ns, exposure {} us, gain {} mdB, verdict {}",
      frame.sequence, frame.slot, frame.mid_exposure.ns(), frame.received.ns(), frame.in_effect.exposure.us(),
      frame.in_effect.gain.mdb(), static_cast<int>(frame.verdict));
}

std::string closed(const SetClosed& event) {
  std::string text = fmt::format("set {} closes: heads", event.number);
  for (std::size_t i = 0; i < kMaxHeads; ++i) {
    if ((event.mask & head_bit(i)) != 0) text += fmt::format(" {}{:+}", i, event.sync.offset[i].ns());
  }
  text += fmt::format(" ns around {} ns, {}, spread {} ns", event.mid_exposure.ns(),
                      genlock_state_name(event.sync.state), event.sync.spread.ns());
  if (event.sync.trigger) text += fmt::format(", pulse {}", *event.sync.trigger);
  if (event.sync.begin_spread) text += fmt::format(", begins {} ns apart", event.sync.begin_spread->ns());
  if (event.sync.drift_ppb) text += fmt::format(", drift {} ppb", *event.sync.drift_ppb);
  return text;
}

std::string command(const CaptureRequest& command) {
  std::string text = fmt::format("command {}: ", command.ticket);
  if (const auto* heads = std::get_if<HeadChange>(&command.what)) {
    text += fmt::format("heads {:#x}", heads->heads);
    if (heads->lease != 0) text += ", temporary";
    if (heads->change.exposure) text += fmt::format(", exposure {} us", heads->change.exposure->us());
    if (heads->change.gain) text += fmt::format(", gain {} mdB", heads->change.gain->mdb());
    return text;
  }
  if (std::holds_alternative<GenlockStart>(command.what)) return text + "start the genlock";
  if (std::holds_alternative<GenlockStop>(command.what)) return text + "stop the genlock";
  if (std::holds_alternative<LeaseEnd>(command.what)) return text + "end temporary settings";
  return text + "change the exposure program";
}

template <class... Cases>
struct Cases_ : Cases... {
  using Cases::operator()...;
};
template <class... Cases>
Cases_(Cases...) -> Cases_<Cases...>;

}  // namespace

std::string place_of(const CaptureEvent& event, const RigConfig& config) {
  return std::visit(Cases_{[&](const HeadOpened& e) { return head_name(e.head, config); },
                           [&](const HeadCalled& e) { return head_name(e.head, config); },
                           [&](const HeadDelivered& e) { return head_name(e.head, config); },
                           [&](const HeadFailed& e) { return head_name(e.head, config); },
                           [&](const FramesLost& e) { return head_name(e.head, config); },
                           [](const TriggerStarted&) { return std::string("trigger"); },
                           [](const TriggerStopped&) { return std::string("trigger"); },
                           [](const PulseSeen&) { return std::string("trigger"); },
                           [](const TriggerFailed&) { return std::string("trigger"); },
                           [](const CommandTaken&) { return std::string("commands"); },
                           [](const CommandAnswered&) { return std::string("commands"); },
                           [](const LightTaken&) { return std::string("light meter"); },
                           [](const SetClosed&) { return std::string("sets"); },
                           [](const SetReturned&) { return std::string("sets"); },
                           [](const GenlockChanged&) { return std::string("genlock"); },
                           [](const StepBegun&) { return std::string("clock"); }},
                    event);
}

std::string text_of(const CaptureEvent& event) {
  return std::visit(
      Cases_{[](const StepBegun& e) { return fmt::format("a step begins at {} ns", e.now.ns()); },
             [](const HeadOpened& e) { return "opens" + outcome(e.status); },
             [](const HeadCalled& e) { return called(e); }, [](const HeadDelivered& e) { return delivered(e.frame); },
             [](const HeadFailed& e) { return "fails: " + e.error.message; },
             [](const TriggerStarted& e) {
               return fmt::format("starts at {}/{} a second", e.settings.rate.numerator, e.settings.rate.denominator) +
                      outcome(e.status);
             },
             [](const TriggerStopped&) { return std::string("stops"); },
             [](const PulseSeen& e) { return fmt::format("pulse {} at {} ns", e.edge.number, e.edge.at.ns()); },
             [](const TriggerFailed& e) { return "fails: " + e.error.message; },
             [](const LightTaken& e) { return fmt::format("the light of set {}", e.light.set); },
             [](const CommandTaken& e) { return command(e.command); },
             [](const CommandAnswered& e) {
               return fmt::format("command {} {}", e.ticket,
                                  e.status ? "is done" : "fails: " + e.status.error().message);
             },
             [](const SetClosed& e) { return closed(e); },
             [](const SetReturned& e) { return fmt::format("the frames of set {} go back to the heads", e.number); },
             [](const FramesLost& e) {
               return fmt::format("has lost {} frames as {}", e.count, loss_reason_name(e.reason));
             },
             [](const GenlockChanged& e) { return fmt::format("is {}", genlock_state_name(e.state)); }},
      event);
}

}  // namespace nodal::flight
