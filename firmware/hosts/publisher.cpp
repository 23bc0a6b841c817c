#include "firmware/hosts/publisher.h"

#include <fmt/format.h>

#include <algorithm>

#include "firmware/hosts/shared_bytes.h"
#include "firmware/hosts/status.h"
#include "firmware/picture/blender.h"
#include "firmware/picture/encoder.h"
#include "protocol/base/raymap_rate.h"
#include "protocol/base/try.h"
#include "protocol/upload.h"
#include "stitch/sets/full_exposure.h"

namespace nodal::firmware {
namespace {

/// Buffers that the frame path itself uses: in the blend (two, one per field), in the encoder, and in the rings
/// between.
constexpr std::size_t kInThePath = 8;
static_assert(Publisher::kMaxPinned + kLosslessQueueItems + kInThePath <= Blender::kMaxBuffers);
static_assert(Publisher::kMaxPinned + kLosslessQueueItems + kInThePath <= EncodeStage::kMaxBuffers);

std::string in_mib(std::size_t bytes) { return fmt::format("{} MiB", bytes >> 20); }

bool wanted(const Clients& clients, wire::PullRequest::Coding coding) {
  return std::any_of(clients.begin(), clients.end(), [&](const auto& client) {
    return std::any_of(client->pulls.begin(), client->pulls.end(),
                       [&](const auto& pull) { return pull.second.coding == coding && !pull.second.ended; });
  });
}

}  // namespace

Result<StreamId> Publisher::start(const Clients& clients, Client& client, const wire::PullRequest& request) {
  if (client.pulls.size() >= kMaxPulls) {
    return fail(Errc::kOverload, fmt::format("this host has {} pulls already; stop one first", kMaxPulls));
  }
  // A host's first pull is never refused because of other hosts' pulls.
  std::size_t extra = client.pulls.empty() ? 0 : 1;
  for (const auto& other : clients) extra += other->pulls.empty() ? 0 : other->pulls.size() - 1;
  if (!client.pulls.empty() && extra > kMaxExtraPulls) {
    return fail(Errc::kOverload, fmt::format("the rig has buffers for {} additional pulls of hosts, and all are in "
                                             "use; `nodal hosts` lists the hosts and can close one",
                                             kMaxExtraPulls));
  }
  if (request.coding() < wire::PullRequest::JPEG || request.coding() > wire::PullRequest::EVIDENCE) {
    return fail(Errc::kUnsupported,
                fmt::format("this rig does not support the coding {}", static_cast<int>(request.coding())));
  }
  const StreamPolicy policy = request.lossless() ? StreamPolicy::kLossless : StreamPolicy::kLatest;
  NODAL_TRY_ASSIGN(auto stream, client.session().open_stream(policy));
  Pull& pull = client.pulls[stream];
  pull.coding = request.coding();
  pull.lossless = request.lossless();
  pull.count = request.count();
  return stream;
}

Status Publisher::stop(Client& client, StreamId stream) {
  const auto pull = client.pulls.find(stream);
  if (pull == client.pulls.end()) {
    return fail(Errc::kNotFound, fmt::format("this host has no pull on stream {}", stream));
  }
  if (!pull->second.ended) client.session().close_stream(stream);
  pull->second.ended = true;
  return {};
}

bool Publisher::step(const Clients& clients) {
  for (const auto& client : clients) remove_ended(*client);
  const auto raymap = raymaps_in_.take();
  if (!raymap) return false;
  bool given = false;
  for (const auto& client : clients) {
    for (auto& [stream, pull] : client->pulls) given |= offer(*client, stream, pull, *raymap);
  }
  if (given) ++published_;
  if (raymap->shed) ++shed_;
  return true;
}

std::size_t Publisher::most_pending(std::size_t bytes) {
  return std::clamp(kLosslessBytes / std::max<std::size_t>(bytes, 1), kLosslessMin, kLosslessQueueItems);
}

bool Publisher::offer(Client& client, StreamId stream, Pull& pull, const Raymap& raymap) {
  const bool jpeg = pull.coding == wire::PullRequest::JPEG;
  const bool evidence = pull.coding == wire::PullRequest::EVIDENCE;  // without pixels, and so never shed
  const bool present = jpeg ? static_cast<bool>(raymap.jpeg) : static_cast<bool>(raymap.pixels);
  // Both fields have the evidence of their set, which is sent once.
  const bool repeated = evidence && raymap.info.field && raymap.info.field->number > 0;
  const bool shed = raymap.shed && !pull.lossless && !evidence;
  const auto before = client.session().counts(stream);
  if (pull.ended || repeated || shed || !before || client.ending()) return false;
  if (!evidence && !present) {
    // Raymaps that were already in the path when the pull began may lack a JPEG or pixels; that is no loss.
    if (pull.lossless && before->offered > 0) {
      end_lossless(
          client, stream, pull,
          {Errc::kOverload, fmt::format("a raymap could not be encoded; set {} would be missing", raymap.info.set)});
    }
    return false;
  }
  const std::size_t most = most_pending(evidence ? 0 : jpeg ? raymap.jpeg->size() : raymap.pixels->size());
  if (pull.lossless && before->pending >= most) {
    end_lossless(
        client, stream, pull,
        {Errc::kTimeout,
         fmt::format("this lossless pull is too slow: its backlog is {} raymaps, and the rig keeps at most {} or {}; "
                     "the raymaps until here are complete. Pull JPEGs, use a faster link, or leave out --lossless",
                     most, kLosslessQueueItems, in_mib(kLosslessBytes))});
    return false;
  }
  if (!client.session().offer(stream, item(raymap, pull.coding))) return false;
  const auto after = client.session().counts(stream);
  if (pull.count != 0 && after && after->delivered + after->pending >= pull.count) {
    client.session().close_stream(stream);
    pull.ended = true;
  }
  return true;
}

void Publisher::end_lossless(Client& client, StreamId stream, Pull& pull, Error why) {
  news_.push_back(client.name() + ": " + why.message);
  client.session().close_stream(stream, std::move(why));
  pull.ended = true;
  ++client.lossless_ended;
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
  header.set_layout(config_.layout);
  if (const auto rate = raymap_rate(info.rate, config_.raymaps_a_set())) {
    header.set_rate_numerator(rate->numerator);
    header.set_rate_denominator(rate->denominator);
  }
  header.set_calibration_id(sha256_to_wire(info.calibration));
  header.set_heads_mask(info.heads);
  for (std::size_t i = 0; info.heads >> i != 0; ++i) {
    const bool present = (info.heads & head_bit(i)) != 0;
    header.add_exposure_ns(present ? static_cast<std::uint64_t>(info.in_effect[i].exposure.duration().ns()) : 0);
    header.add_gain_mdb(present ? info.in_effect[i].gain.mdb() : 0);
  }
  if (info.field) {
    header.set_field(static_cast<std::uint32_t>(info.field->number));
    header.set_parity(std::string(field_parity_name(info.field->parity)));
  }
  if (info.linear && info.linear->full) {
    header.set_full_exposure_ns(sets::full_exposure_ns(*info.linear->full));
  }
  fill_sync(info, header);
  const SharedBytes body = jpeg ? shared_bytes(raymap.jpeg) : raw ? shared_bytes(raymap.pixels) : SharedBytes();
  return BulkItem{header.SerializeAsString(), body, 0};
}

void Publisher::remove_ended(Client& client) {
  for (auto entry = client.pulls.begin(); entry != client.pulls.end();) {
    Pull& pull = entry->second;
    const auto counts = client.session().counts(entry->first);
    if (counts) pull.dropped = counts->dropped;
    if (counts) {  // the stream is not closed yet: its last raymap may still be in the queue
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
