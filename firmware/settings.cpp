#include "firmware/settings.h"

#include <string_view>

#include "protocol/upload.h"

namespace nodal::firmware {
namespace {

constexpr std::string_view kHead = "nodal-settings 1\n";  // then the SHA-256 of what follows it: wire::RigSettings

Sha256 sha256_of(std::string_view text) {
  return sha256(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

}  // namespace

bool Settings::remember(const wire::Request& request, std::size_t heads) {
  if (request.has_genlock()) {
    if (request.genlock().action() == wire::GenlockRequest::SHOW) return false;
    genlock_ = request.genlock();
    return true;
  }
  if (request.has_exposure()) {
    if (!exposure_) exposure_.emplace();
    exposure_->MergeFrom(request.exposure());
    return true;
  }
  if (!request.has_head_set()) return false;
  wire::HeadSetRequest wish = request.head_set();
  std::vector<std::uint32_t> set(wish.heads().begin(), wish.heads().end());
  for (std::uint32_t head = 0; set.empty() && head < heads; ++head) heads_[head].MergeFrom(wish);
  wish.clear_heads();
  for (const std::uint32_t head : set) heads_[head].MergeFrom(wish);
  return true;
}

std::vector<wire::Request> Settings::requests() const {
  std::vector<wire::Request> all;
  // Heads are set by hand while no program does, so that comes first whatever rig.toml says.
  if (exposure_) all.emplace_back().mutable_exposure()->set_program("manual");
  for (const auto& [head, wish] : heads_) {
    wire::HeadSetRequest& request = *all.emplace_back().mutable_head_set();
    request = wish;
    request.add_heads(head);
  }
  if (exposure_) *all.emplace_back().mutable_exposure() = *exposure_;
  if (genlock_) *all.emplace_back().mutable_genlock() = *genlock_;
  return all;
}

std::string Settings::encode(const Sha256& rig_toml) const {
  wire::RigSettings stored;
  stored.set_rig_toml(sha256_to_wire(rig_toml));
  for (const wire::Request& request : requests()) *stored.add_requests() = request;
  const std::string body = stored.SerializeAsString();
  return std::string(kHead) + sha256_to_wire(sha256_of(body)) + body;
}

Result<Settings> Settings::decode(std::span<const std::uint8_t> file, const Sha256& rig_toml) {
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  const std::size_t head = kHead.size() + Sha256{}.size();
  if (!text.starts_with(kHead) || text.size() < head) {
    return fail(Errc::kBadFormat, "the remembered settings are not readable; the rig starts as rig.toml says");
  }
  const std::string_view body = text.substr(head);
  if (text.substr(kHead.size(), Sha256{}.size()) != sha256_to_wire(sha256_of(body))) {
    return fail(Errc::kChecksum, "the remembered settings are damaged; the rig starts as rig.toml says");
  }
  wire::RigSettings stored;
  if (!stored.ParseFromArray(body.data(), static_cast<int>(body.size()))) {
    return fail(Errc::kBadFormat, "the remembered settings are not readable; the rig starts as rig.toml says");
  }
  if (stored.rig_toml() != sha256_to_wire(rig_toml)) {
    return fail(Errc::kWrongState, "rig.toml was changed since hosts set the rig; it starts as rig.toml says");
  }
  Settings settings;
  for (const wire::Request& request : stored.requests()) settings.remember(request, 0);
  return settings;
}

}  // namespace nodal::firmware
