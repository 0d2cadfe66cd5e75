import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vite';
import { decoderAlias } from '../decoder_alias.js';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));

// The package: three.js stays outside, as a peer. The worker and the decoder lie beside the module.
export default defineConfig({
  root: here('.'),
  base: './',
  resolve: { alias: decoderAlias },
  worker: { format: 'es', rollupOptions: { output: { entryFileNames: 'v3d-player-worker.js', assetFileNames: '[name][extname]' } } },
  build: {
    outDir: process.env.V3D_PLAYER_OUT ?? here('dist'),
    emptyOutDir: true,
    assetsInlineLimit: 0,
    target: 'es2022',
    modulePreload: false,
    reportCompressedSize: false,
    rollupOptions: {
      input: { 'v3d-player': here('src/index.ts') },
      preserveEntrySignatures: 'strict',
      external: [/^three($|\/)/],
      output: { entryFileNames: '[name].js', assetFileNames: '[name][extname]' },
    },
  },
});
