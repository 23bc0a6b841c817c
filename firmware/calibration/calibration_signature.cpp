#include "firmware/calibration/calibration_signature.h"

#include <cstdint>
#include <span>
#include <string>

namespace nodal::firmware {

Status check_signature(const std::optional<AllowedSigners>& signers, const SignedDocument& original) {
  if (!signers) return {};
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(original.json.data()), original.json.size());
  const auto signer = signers->verify(bytes, original.signature, kCalibrationNamespace);
  if (!signer) return fail(signer.error());
  return {};
}

Result<Calibration> load_permitted(const CalibrationStore& store, const std::optional<AllowedSigners>& signers,
                                   const Sha256& id) {
  auto calibration = store.load(id);
  if (!calibration || !signers) return calibration;
  const std::string name = "stored calibration " + to_hex(id).substr(0, 12);
  const auto original = store.original(id);
  if (!original) return fail(original.error().in(name));
  const SignedDocument document = original->value_or(SignedDocument{});
  if (Status permitted = check_signature(signers, document); !permitted) return fail(permitted.error().in(name));
  const auto was_signed = parse_calibration(document.json);
  if (!was_signed || calibration_id(*was_signed) != id) {
    return fail(Errc::kChecksum, name + ": its signature is for another calibration");
  }
  return calibration;
}

}  // namespace nodal::firmware
