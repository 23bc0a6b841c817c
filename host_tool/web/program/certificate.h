// The self-signed certificate of the web server in front of nodal-web.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host::web {

struct Certificate {
  std::string key;          ///< PEM
  std::string certificate;  ///< PEM
};

/// A new key (ECDSA P-256) and its certificate for names and addresses, the first of them its subject. It is valid from
/// 2020 to 2049, because clocks of boards without a battery are wrong: phones know it by its hash.
/// Errors: kIo if the library makes none.
Result<Certificate> make_certificate(const std::vector<std::string>& names);

/// SHA-256 of a PEM file's first certificate, as browsers show it: "AB:CD:...", 32 bytes.
/// Errors: kNotFound, kIo, kBadFormat, each with the file.
Result<std::string> fingerprint_of(const std::filesystem::path& certificate);

}  // namespace nodal::host::web
