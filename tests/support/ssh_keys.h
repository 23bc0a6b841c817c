// Keys and signatures that the real ssh-keygen makes.
#pragma once

#include <string>

namespace nodal::test {

/// A folder with keys, gone with the object.
class SshKeys {
 public:
  SshKeys();
  ~SshKeys();
  SshKeys(const SshKeys&) = delete;
  SshKeys& operator=(const SshKeys&) = delete;

  /// Makes a key of that name; `kind` as ssh-keygen's -t. Its public half: "ssh-ed25519 AAAA... NAME".
  std::string make(const std::string& name, const std::string& kind = "ed25519");
  /// Its signature of `document`, armoured. `hash`: sha512 or sha256.
  std::string sign(const std::string& name, const std::string& document,
                   const std::string& name_space = "nodal-calibration", const std::string& hash = "sha512");
  /// What `ssh-keygen -Y verify` says of it for `principal`.
  bool verifies(const std::string& allowed_signers, const std::string& principal, const std::string& document,
                const std::string& signature);

 private:
  std::string folder_;
};

}  // namespace nodal::test
