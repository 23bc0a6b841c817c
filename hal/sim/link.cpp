#include "hal/sim/link.h"

#include <fmt/format.h>

#include <algorithm>

namespace nodal::hal::sim {
namespace {

/// The number of bytes that one call moves: as many as possible, or a random number from the seed.
std::size_t draw(LinkPipe& pipe, std::size_t most) {
  if (pipe.split == 0 || most == 0) return most;
  return std::min<std::size_t>(most, 1 + pipe.random() % pipe.split);
}

}  // namespace

SimLink::SimLink(std::shared_ptr<LinkPipe> in, std::shared_ptr<LinkPipe> out, std::string peer,
                 std::optional<PeerIdentity> identity)
    : in_(std::move(in)), out_(std::move(out)), peer_(std::move(peer)), identity_(identity) {}

SimLink::~SimLink() {
  in_->reader_gone = true;
  out_->writer_gone = true;
}

Result<std::size_t> SimLink::read(std::span<std::uint8_t> into) {
  if (in_->reset) return fail(Errc::kLinkClosed, peer_ + ": the link was reset");
  if (in_->stalled || into.empty()) return 0;
  if (in_->bytes.empty()) {
    if (in_->writer_gone) return fail(Errc::kLinkClosed, peer_ + ": the other end closed the link");
    return 0;
  }
  const std::size_t n = draw(*in_, std::min(into.size(), in_->bytes.size()));
  const auto end = in_->bytes.begin() + static_cast<std::ptrdiff_t>(n);
  std::copy(in_->bytes.begin(), end, into.begin());
  in_->bytes.erase(in_->bytes.begin(), end);
  return n;
}

/// At once while it can go on. Nothing else can be known beforehand: the same thread runs the peer.
void SimLink::add_wake_ups(WakeUps& to, bool to_read, bool to_write) const {
  const bool something = in_->reset || (!in_->stalled && (!in_->bytes.empty() || in_->writer_gone));
  const bool room = out_->reset || out_->reader_gone || out_->bytes.size() < out_->capacity;
  if ((to_read && something) || (to_write && room)) to.at(Instant());
}

Result<std::size_t> SimLink::write(std::span<const std::uint8_t> from) {
  if (out_->reset) return fail(Errc::kLinkClosed, peer_ + ": the link was reset");
  if (out_->reader_gone) return fail(Errc::kLinkClosed, peer_ + ": the other end closed the link");
  const std::size_t room = out_->capacity - std::min(out_->capacity, out_->bytes.size());
  const std::size_t n = draw(*out_, std::min(from.size(), room));
  out_->bytes.insert(out_->bytes.end(), from.begin(), from.begin() + static_cast<std::ptrdiff_t>(n));
  if (out_->flip_bit && *out_->flip_bit / 8 < n) {
    const std::size_t back = n - static_cast<std::size_t>(*out_->flip_bit / 8);
    out_->bytes[out_->bytes.size() - back] ^= static_cast<std::uint8_t>(1U << (*out_->flip_bit % 8));
    out_->flip_bit.reset();
  } else if (out_->flip_bit) {
    *out_->flip_bit -= 8 * n;
  }
  out_->written += n;
  return n;
}

void SimLink::reset() {
  for (LinkPipe* pipe : {in_.get(), out_.get()}) {
    pipe->reset = true;
    pipe->bytes.clear();
  }
}

std::pair<std::unique_ptr<SimLink>, std::unique_ptr<SimLink>> make_link_pair(std::string a_sees, std::string b_sees) {
  auto a_to_b = std::make_shared<LinkPipe>();
  auto b_to_a = std::make_shared<LinkPipe>();
  return {std::make_unique<SimLink>(b_to_a, a_to_b, std::move(a_sees)),
          std::make_unique<SimLink>(a_to_b, b_to_a, std::move(b_sees))};
}

Result<std::unique_ptr<LinkPort>> SimLinkListener::accept() {
  if (knocking_.empty()) return nullptr;
  std::unique_ptr<LinkPort> link = std::move(knocking_.front());
  knocking_.pop_front();
  return link;
}

std::unique_ptr<SimLink> SimLinkListener::connect(PeerIdentity host) {
  auto to_rig = std::make_shared<LinkPipe>();
  auto to_host = std::make_shared<LinkPipe>();
  knocking_.push_back(std::make_unique<SimLink>(to_rig, to_host, fmt::format("sim:host{}", ++count_), host));
  return std::make_unique<SimLink>(to_host, to_rig, "sim:rig");
}

}  // namespace nodal::hal::sim
