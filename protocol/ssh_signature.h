// Verifies signatures made by `ssh-keygen -Y sign` against the keys of an allowed_signers file: OpenSSH's
// PROTOCOL.sshsig, and ALLOWED SIGNERS in ssh-keygen(1). Ed25519 keys only.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal {

/// The namespace of a calibration's signature (ssh-keygen's -n) begins with this; signed_for.h says what follows.
inline constexpr std::string_view kCalibrationNamespace = "nodal-calibration";
/// A signature by an Ed25519 key has about 300 bytes.
inline constexpr std::size_t kMaxSignatureBytes = 4096;
inline constexpr std::size_t kMaxAllowedSignersBytes = 64 * 1024;
inline constexpr std::size_t kMaxSigners = 64;

/// The keys that are trusted to sign.
///
/// Threading: immutable after parse().
/// Ownership: none.
/// Errors: parse(): kTooLarge, kBadFormat, kUnsupported, naming the line. verify(): kBadValue (no signature, an
///   untrusted key, another namespace), kBadFormat (not a signature), kChecksum (a signature of another document, or
///   damaged), kUnsupported (a key that is not Ed25519).
class AllowedSigners {
 public:
  /// Lines of "PRINCIPALS [namespaces="..."] ssh-ed25519 BASE64 [COMMENT]"; empty lines and comments (#) are skipped.
  /// Other options (cert-authority, valid-before, ...) are refused, because ignoring them would trust too much.
  static Result<AllowedSigners> parse(std::string_view text);

  struct Verified {
    std::string principals;  ///< whose key signed
    std::string name_space;  ///< as signed: `purpose`, or `purpose` and what follows ":"
  };
  /// Checks that a trusted key signed `document` for the namespace `purpose` or one below it ("PURPOSE:...");
  /// `signature` is armoured. A signer is trusted for `purpose` if its namespaces have `purpose`, `purpose` and "*", or
  /// the one that was signed.
  Result<Verified> verify(std::span<const std::uint8_t> document, std::string_view signature,
                          std::string_view purpose) const;
  std::size_t size() const { return signers_.size(); }

 private:
  using Key = std::array<std::uint8_t, 32>;
  struct Signer {
    std::string principals;
    std::vector<std::string> namespaces;  ///< empty: any
    Key key{};
  };
  static Result<Signer> parse_line(std::string_view line);

  std::vector<Signer> signers_;
};

}  // namespace nodal
