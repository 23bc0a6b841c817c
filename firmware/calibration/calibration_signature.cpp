#include "firmware/calibration/calibration_signature.h"

#include <fmt/format.h>

#include <span>

#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/signed_for.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kLongestRig = 64;  // bytes of another rig's name, in a message

/// "…; sign it: ssh-keygen -Y sign -n nodal-calibration:bridge:8 -f KEY FILE".
Error with_command(Error error, const SignatureRules& rules) {
  error.message +=
      "; sign it: ssh-keygen -Y sign -n " + namespace_of({rules.rig, rules.generation + 1}) + " -f KEY FILE";
  return error;
}

}  // namespace

Result<Permitted> check_signature(const SignatureRules& rules, const SignedDocument& original) {
  if (!rules.signers) return Permitted{};
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(original.json.data()), original.json.size());
  const auto verified = rules.signers->verify(bytes, original.signature, kCalibrationNamespace);
  if (!verified) return fail(with_command(verified.error(), rules));
  if (verified->name_space == kCalibrationNamespace) return Permitted{};
  const auto what = parse_namespace(verified->name_space);
  if (!what) return fail(with_command(what.error(), rules));
  if (what->rig != rules.rig) {
    return fail(with_command({Errc::kBadValue, "it is signed for the rig '" + printable(what->rig, kLongestRig) +
                                                   "', and this is '" + rules.rig + "'"},
                             rules));
  }
  return Permitted{what->generation};
}

Status check_generation(const SignatureRules& rules, const Permitted& permitted, bool known) {
  if (!rules.signers || permitted.generation > rules.generation) return {};
  if (permitted.generation == rules.generation && permitted.generation != 0 && known) return {};
  const std::string what = permitted.generation == 0
                               ? "its signature names no rig and no generation"
                               : fmt::format("its signature is of generation {}, and this rig has had generation {}",
                                             permitted.generation, rules.generation);
  return fail(with_command({Errc::kBadValue, what + "; --allow-older permits it"}, rules));
}

Result<LoadedCalibration> load_permitted(const CalibrationStore& store, const SignatureRules& rules, const Sha256& id) {
  NODAL_TRY_ASSIGN(auto calibration, store.load(id));
  if (!rules.signers) return LoadedCalibration{std::move(calibration), {}};
  const std::string name = "stored calibration " + to_hex(id).substr(0, 12);
  const auto original = store.original(id);
  if (!original) return fail(original.error().in(name));
  const SignedDocument document = original->value_or(SignedDocument{});
  const auto permitted = check_signature(rules, document);
  if (!permitted) return fail(permitted.error().in(name));
  const auto was_signed = parse_calibration(document.json);
  if (!was_signed || calibration_id(*was_signed) != id) {
    return fail(Errc::kChecksum, name + ": its signature is for another calibration");
  }
  return LoadedCalibration{std::move(calibration), *permitted};
}

bool has_signature(const CalibrationStore& store, const SignatureRules& rules, const Sha256& id,
                   const Permitted& same) {
  const auto stored = load_permitted(store, rules, id);
  return stored && stored->permitted.generation == same.generation;
}

}  // namespace nodal::firmware
