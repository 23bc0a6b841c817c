// Keys and signatures made by the real ssh-keygen.
#pragma once

#include <string>

namespace nodal::test {

/// A temporary folder with keys; the destructor removes it.
class SshKeys {
 public:
  SshKeys();
  ~SshKeys();
  SshKeys(const SshKeys&) = delete;
  SshKeys& operator=(const SshKeys&) = delete;

  /// Makes a key with this name; `kind` is ssh-keygen's -t. Returns its public half: "ssh-ed25519 AAAA... NAME".
  std::string make(const std::string& name, const std::string& kind = "ed25519");
  /// Signs `document` with the key; returns the armoured signature. `hash`: sha512 or sha256.
  std::string sign(const std::string& name, const std::string& document,
                   const std::string& name_space = "nodal-calibration", const std::string& hash = "sha512");
  /// The result of `ssh-keygen -Y verify` for `principal`.
  bool verifies(const std::string& allowed_signers, const std::string& principal, const std::string& document,
                const std::string& signature, const std::string& name_space = "nodal-calibration");

 private:
  std::string folder_;
};

}  // namespace nodal::test
