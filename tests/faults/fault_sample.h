// Choice of the faults that a test injects into an operation.
#pragma once

#include <string>
#include <vector>

#include "faulty_program.h"

namespace v3d::test {

/// Every fault of the calls of the run `counted`: each call with each of its errors, alone, and
/// with every later call of its family.
std::vector<Fault> all_faults(const ProgramResult& counted, const std::string& program);

/// A sample of about `size` faults with a fixed seed: first one of each family of calls, which
/// `size` does not limit, then one of each pair of family and error, then any. The
/// environment can ask for others: V3D_FAULTS=all for all, or for the share of them that
/// V3D_FAULTS_SHARE=K/N names; another text for those whose text_of() contains it.
std::vector<Fault> sampled(std::vector<Fault> faults, size_t size);

/// The part `part` of `parts` parts of equal size, so that test programs can share the work.
std::vector<Fault> share_of(const std::vector<Fault>& faults, size_t part, size_t parts);

/// True for short transfers, and for EINTR of a call that waits: the program repeats the call or
/// continues. Other calls fail with EINTR only on network file systems, where it is an error.
bool must_succeed(const Fault& fault);

/// The text of the error, as strerror() gives it. Empty for short transfers.
std::string cause_of(const Fault& fault);

/// "open 3 EIO and all later calls".
std::string text_of(const Fault& fault);

}  // namespace v3d::test
