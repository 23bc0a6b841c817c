#include "tests/sim/line.h"

#include <array>

namespace nodal::swarm {

std::optional<nodal::Event> Line::take() {
  for (;;) {
    if (auto event = session_.next_event()) return event;
    if (gone_ || !session_.wants_input()) return std::nullopt;
    std::array<std::uint8_t, 4096> bytes;
    const auto read = link_->read(bytes);
    if (!read) leave();
    if (!read || *read == 0) return std::nullopt;
    (void)session_.receive(std::span(bytes).first(*read));  // events before an error can still be taken
  }
}

void Line::write() {
  while (!gone_ && !session_.output().empty()) {
    const auto output = session_.output();
    const auto wrote = link_->write(output);
    if (!wrote) leave();
    if (!wrote || *wrote == 0) return;
    recently_written_.assign(output.begin(), output.begin() + static_cast<std::ptrdiff_t>(*wrote));
    session_.sent(*wrote);
  }
}

bool Line::write_raw(std::span<const std::uint8_t> bytes) {
  if (gone_) return false;
  const auto wrote = link_->write(bytes);
  if (!wrote) leave();
  return wrote && *wrote == bytes.size();
}

}  // namespace nodal::swarm
