declare module 'v3d_decoder.wasm?url' {
  const url: string;
  export default url;
}
