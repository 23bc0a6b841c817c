#include "tests/sim/world.h"

namespace nodal::swarm {

World::World(const Nature& nature)
    : trigger_(clock_, queue_, nature.trigger, nature.seed, [this](PulseId pulse, Instant at) {
        for (const auto& head : heads_) head->on_pulse(pulse, at);
      }) {
  for (std::size_t i = 0; i < nature.head.size(); ++i) {
    heads_.push_back(std::make_unique<Head>(static_cast<std::uint8_t>(i), clock_, queue_, nature.head[i], nature.seed));
  }
}

Result<std::unique_ptr<hal::HeadPort>> World::Enumerator::open(const std::string& path) {
  for (const auto& head : world_.heads_) {
    if (head->path() == path) return head->open();
  }
  return fail(Errc::kNoSuchDevice, "head '" + path + "': the swarm has no such head");
}

void World::step_clock(Duration by) {
  clock_.advance(by);
  queue_.shift(by);
  trigger_.shift(by);
  for (const auto& head : heads_) head->shift(by);
}

bool World::on_event(const Event& event) {
  switch (event.kind) {
    case EventKind::kPulse: trigger_.on_event(event); return false;
    case EventKind::kExpose: heads_[event.who]->on_expose(event); return false;
    case EventKind::kArrive: return heads_[event.who]->on_arrive(event);
    case EventKind::kStep:
    case EventKind::kHost:
    case EventKind::kPlan: break;
  }
  return false;
}

}  // namespace nodal::swarm
