import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';
import { decoderAlias } from './decoder_alias.js';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));

// `npx vite` beside a running v3d-viewd: all requests other than pages go to the daemon.
const daemon = 'http://127.0.0.1:8330';

export default defineConfig({
  base: './',
  resolve: { alias: decoderAlias },
  worker: { format: 'es' },
  build: {
    outDir: process.env.V3D_VIEWER_OUT ?? 'dist',
    emptyOutDir: true,
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1000,
    rollupOptions: { input: { index: here('index.html'), studio: here('studio.html') } },
  },
  server: { fs: { allow: ['../..'] }, proxy: { '/api': { target: daemon, ws: true }, '/takes': daemon } },
  test: { include: ['tests/*.test.ts'], testTimeout: 60_000 },
});
