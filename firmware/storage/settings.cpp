#include "firmware/storage/settings.h"

#include <algorithm>
#include <string_view>

#include "firmware/config/exposure_settings.h"
#include "protocol/base/units.h"
#include "protocol/upload.h"

namespace nodal::firmware {
namespace {

constexpr std::string_view kHead = "nodal-settings 1\n";  // then the SHA-256 of what follows it: wire::RigSettings

Sha256 sha256_of(std::string_view text) {
  return sha256(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

// Settings are rebuilt field by field. MergeFrom() would also copy the fields that this program does not know, and add
// them to those that are there: with every request the settings would grow by what its sender likes.

void take_fields(const wire::HeadSetRequest& from, wire::HeadSetRequest& into) {
  if (from.has_exposure_ns()) into.set_exposure_ns(from.exposure_ns());
  if (from.has_gain_mdb()) into.set_gain_mdb(from.gain_mdb());
  if (from.has_red_q12()) into.set_red_q12(from.red_q12());
  if (from.has_blue_q12()) into.set_blue_q12(from.blue_q12());
  if (from.has_gamma()) into.set_gamma(from.gamma());
}

void take_fields(const wire::ExposureRequest& from, wire::ExposureRequest& into) {
  if (const auto program = exposure_program_of(from.program())) {
    into.set_program(std::string(exposure_program_name(*program)));
  }
  if (from.has_anchor()) into.set_anchor(from.anchor());
  if (from.has_target_below()) into.set_target_below(from.target_below());
  if (from.has_difference()) into.set_difference(from.difference());
  if (from.has_ramp()) into.set_ramp(from.ramp());
  if (from.has_longest_ns()) into.set_longest_ns(from.longest_ns());
  if (from.has_highest_gain_mdb()) into.set_highest_gain_mdb(from.highest_gain_mdb());
  if (from.has_locked()) into.set_locked(from.locked());
}

wire::GenlockRequest known_fields(const wire::GenlockRequest& from) {
  wire::GenlockRequest into;
  into.set_action(from.action());
  into.set_rate_numerator(from.rate_numerator());
  into.set_rate_denominator(from.rate_denominator());
  into.set_pulse_width_ns(from.pulse_width_ns());
  return into;
}

}  // namespace

bool Settings::remember(const wire::Request& request, std::size_t heads) {
  if (request.has_genlock()) {
    if (request.genlock().action() == wire::GenlockRequest::SHOW) return false;
    genlock_ = known_fields(request.genlock());
    return true;
  }
  if (request.has_exposure()) {
    if (!exposure_) exposure_.emplace();
    take_fields(request.exposure(), *exposure_);
    return true;
  }
  if (!request.has_head_set()) return false;
  const wire::HeadSetRequest& wanted = request.head_set();
  for (std::uint32_t head = 0; wanted.heads().empty() && head < std::min<std::size_t>(heads, kMaxHeads); ++head) {
    take_fields(wanted, heads_[head]);
  }
  for (const std::uint32_t head : wanted.heads()) {
    if (head < kMaxHeads) take_fields(wanted, heads_[head]);
  }
  return true;
}

std::vector<wire::Request> Settings::requests() const {
  std::vector<wire::Request> all;
  // Heads are set by hand while no program does, so that comes first whatever rig.toml says.
  if (exposure_) all.emplace_back().mutable_exposure()->set_program("manual");
  for (wire::Request& request : kept()) all.push_back(std::move(request));
  return all;
}

std::vector<wire::Request> Settings::kept() const {
  std::vector<wire::Request> all;
  for (const auto& [head, change] : heads_) {
    wire::HeadSetRequest& request = *all.emplace_back().mutable_head_set();
    request = change;
    request.add_heads(head);
  }
  if (exposure_) *all.emplace_back().mutable_exposure() = *exposure_;
  if (genlock_) *all.emplace_back().mutable_genlock() = *genlock_;
  return all;
}

std::string Settings::encode(const Sha256& rig_toml) const {
  wire::RigSettings stored;
  stored.set_rig_toml(sha256_to_wire(rig_toml));
  for (const wire::Request& request : kept()) *stored.add_requests() = request;
  const std::string body = stored.SerializeAsString();
  std::string file = std::string(kHead) + sha256_to_wire(sha256_of(body)) + body;
  NODAL_ASSERT(file.size() <= kMaxSettingsBytes);  // by construction: known fields of kMaxHeads heads
  return file;
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
