#include "firmware/publisher.h"

#include <algorithm>

#include "firmware/blender.h"
#include "firmware/encoder.h"
#include "firmware/status.h"
#include "protocol/base/stops.h"
#include "protocol/upload.h"

namespace nodal::firmware {
namespace {

/// The loan's bytes as sessions send them; the loan ends with the last of the copies.
SharedBytes shared_bytes(const Buffer& loan) {
  if (!loan) return nullptr;
  const auto holder = std::make_shared<const Buffer>(loan);
  return SharedBytes(holder, &**holder);
}

/// Buffers that a pull may keep.
std::size_t pins(bool lossless) { return lossless ? Publisher::kLosslessQueue : 1; }

bool wanted(const Clients& clients, wire::PullRequest::Coding coding) {
  return std::any_of(clients.begin(), clients.end(), [&](const auto& client) {
    return std::any_of(client->pulls.begin(), client->pulls.end(),
                       [&](const auto& pull) { return pull.second.coding == coding && !pull.second.ended; });
  });
}

}  // namespace

bool HoldBudget::step(bool held, Instant now) {
  const Duration passed = last_ ? std::min(now - *last_, kLongestStep) : Duration();
  last_ = now;
  left_ = held ? left_ - passed : std::min(kMost, left_ + Duration::nanoseconds(passed.ns() / kShare));
  return left_ > Duration();
}

Result<StreamId> Publisher::start(const Clients& clients, Client& client, const wire::PullRequest& request) {
  if (client.pulls.size() >= kMaxPulls) {
    return fail(Errc::kOverload, "this host pulls " + std::to_string(kMaxPulls) + " times already; stop one first");
  }
  std::size_t pinned = pins(request.lossless());
  for (const auto& other : clients) {
    for (const auto& [stream, pull] : other->pulls) pinned += pins(pull.lossless);
  }
  if (pinned > kMaxPinned) {
    return fail(Errc::kOverload, "hosts pull as often as this rig has buffers for; `nodal hosts` lists them and can end one");
  }
  if (request.coding() < wire::PullRequest::JPEG || request.coding() > wire::PullRequest::EVIDENCE) {
    return fail(Errc::kUnsupported, "this rig does not know the coding " + std::to_string(request.coding()));
  }
  const StreamPolicy policy = request.lossless() ? StreamPolicy::kLossless : StreamPolicy::kLatest;
  auto stream = client.session().open_stream(policy);
  if (!stream) return stream;
  Pull& pull = client.pulls[*stream];
  pull.coding = request.coding();
  pull.lossless = request.lossless();
  pull.count = request.count();
  return stream;
}

Status Publisher::stop(Client& client, StreamId stream) {
  const auto pull = client.pulls.find(stream);
  if (pull == client.pulls.end()) {
    return fail(Errc::kNotFound, "no pull of this host goes by stream " + std::to_string(stream));
  }
  if (!pull->second.ended) client.session().close_stream(stream);
  pull->second.ended = true;
  return {};
}

bool Publisher::step(const Clients& clients, Instant now) {
  const bool in_budget = budget_.step(held_up_, now);
  held_up_ = false;
  for (const auto& client : clients) {
    forget_ended(*client);
    if (!in_budget) end_holding(*client);
    for (const auto& [stream, pull] : client->pulls) {
      if (!holds_up(*client, pull, stream)) continue;
      held_up_ = true;
      held_by_ = client->name();
    }
  }
  if (held_up_) return false;
  const auto raymap = raymaps_in_.take();
  if (!raymap) return false;
  bool given = false;
  for (const auto& client : clients) given |= offer(*client, *raymap);
  if (given) ++published_;
  if (raymap->shed) ++shed_;
  return true;
}

bool Publisher::holds_up(const Client& client, const Pull& pull, StreamId stream) const {
  if (!pull.lossless || pull.ended || client.ending()) return false;
  const auto counts = client.session().counts(stream);
  return counts && counts->pending >= kLosslessQueue;
}

void Publisher::end_holding(Client& client) {
  for (auto& [stream, pull] : client.pulls) {
    if (!holds_up(client, pull, stream)) continue;
    client.session().close_stream(
        stream, Error{Errc::kTimeout, "this lossless pull is too slow: hosts may hold the rig up for " +
                                          std::to_string(HoldBudget::kMost.ms() / 1000) + " s and one part in " +
                                          std::to_string(HoldBudget::kShare) +
                                          " of the time, and that is used up; what came so far is complete. Pull JPEGs, "
                                          "over a faster link, or without --lossless"});
    pull.ended = true;
  }
}

bool Publisher::offer(Client& client, const Raymap& raymap) {
  bool given = false;
  for (auto& [stream, pull] : client.pulls) {
    const bool jpeg = pull.coding == wire::PullRequest::JPEG;
    const bool evidence = pull.coding == wire::PullRequest::EVIDENCE;  // costs nothing: it is never shed
    const bool there = jpeg ? static_cast<bool>(raymap.jpeg) : evidence || raymap.pixels;
    // It is a set's; its second field has no other.
    const bool told = evidence && raymap.info.field && raymap.info.field->number > 0;
    const bool shed = raymap.shed && !pull.lossless && !evidence;
    if (pull.ended || !there || told || shed) continue;
    if (!client.session().offer(stream, item(raymap, pull.coding))) continue;
    given = true;
    if (pull.count == 0) continue;
    const auto counts = client.session().counts(stream);
    if (!counts || counts->delivered + counts->pending < pull.count) continue;
    client.session().close_stream(stream);
    pull.ended = true;
  }
  return given;
}

BulkItem Publisher::item(const Raymap& raymap, wire::PullRequest::Coding coding) const {
  const RaymapInfo& info = raymap.info;
  wire::RaymapHeader header;
  header.set_set(info.set);
  header.set_mid_exposure_ns(static_cast<std::uint64_t>(info.mid_exposure.ns()));
  const bool jpeg = coding == wire::PullRequest::JPEG;
  const bool raw = coding == wire::PullRequest::RAW;
  header.set_coding(jpeg ? "jpeg" : raw ? std::string(pixel_format_name(config_.format)) : "none");
  header.set_width(static_cast<std::uint32_t>(config_.width));
  header.set_height(static_cast<std::uint32_t>(config_.height));
  header.set_layout(std::string(raymap_layout_name(config_.layout)));
  header.set_calibration_id(sha256_to_wire(info.calibration));
  header.set_heads_mask(info.heads);
  for (std::size_t i = 0; info.heads >> i != 0; ++i) {
    const bool there = (info.heads & head_bit(i)) != 0;
    header.add_exposure_ns(there ? static_cast<std::uint64_t>(info.in_effect[i].exposure.duration().ns()) : 0);
    header.add_gain_mdb(there ? info.in_effect[i].gain.mdb() : 0);
  }
  if (info.field) {
    header.set_field(static_cast<std::uint32_t>(info.field->number));
    header.set_parity(std::string(field_parity_name(info.field->parity)));
  }
  if (info.linear && info.linear->full) {
    header.set_full_exposure_ns(exp2_stops(std::clamp(*info.linear->full, -9 * kStop, 40 * kStop), 1000));
  }
  fill_sync(info, header);
  return BulkItem{header.SerializeAsString(), shared_bytes(jpeg ? raymap.jpeg : raw ? raymap.pixels : Buffer()), 0};
}

void Publisher::forget_ended(Client& client) {
  for (auto entry = client.pulls.begin(); entry != client.pulls.end();) {
    Pull& pull = entry->second;
    const auto counts = client.session().counts(entry->first);
    if (counts) pull.dropped = counts->dropped;
    if (counts && !(pull.ended && counts->pending == 0)) {
      ++entry;
      continue;
    }
    client.dropped += pull.dropped;
    entry = client.pulls.erase(entry);
  }
}

std::uint64_t Publisher::dropped(const Client& client) {
  std::uint64_t all = client.dropped;
  for (const auto& [stream, pull] : client.pulls) all += pull.dropped;
  return all;
}

bool Publisher::jpeg_wanted(const Clients& clients) { return wanted(clients, wire::PullRequest::JPEG); }
bool Publisher::pixels_wanted(const Clients& clients) { return wanted(clients, wire::PullRequest::RAW); }

bool Publisher::lossless_wanted(const Clients& clients) {
  return std::any_of(clients.begin(), clients.end(), [](const auto& client) {
    return std::any_of(client->pulls.begin(), client->pulls.end(),
                       [](const auto& pull) { return pull.second.lossless && !pull.second.ended; });
  });
}

}  // namespace nodal::firmware
