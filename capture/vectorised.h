// Marks a plain loop that the compiler shall turn into vector code for the processor it runs on.
#pragma once

// The loops are integer arithmetic (or single-precision without fused operations), so every variant
// gives the same bytes. Sanitizers cannot start a program that picks functions while it is loaded.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define V3D_VECTORISED __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define V3D_VECTORISED
#endif
